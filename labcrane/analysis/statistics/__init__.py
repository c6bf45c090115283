"""Tests and fits of measures, through scipy and statsmodels.

In come tables of measures; out go test results with effect sizes and confidence intervals.
"""
