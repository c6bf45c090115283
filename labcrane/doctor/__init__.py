"""Checks of a computer before a study day.

In comes a protocol, or none; out go findings: what is well, what is not, what to do.
"""
