"""Cohorts without people, and the power of a planned test.

In come a study and a population of simulated operators; out go participant files, and how often
the test finds its effect.
"""
