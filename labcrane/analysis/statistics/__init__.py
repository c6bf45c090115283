"""Tests and fits of measures, through scipy and statsmodels.

Input: tables of measures. Output: test results with effect sizes and confidence intervals.
"""
