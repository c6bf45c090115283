"""The report of a cohort: HTML pages, figures and the evaluation workbook.

Input: a cohort with its measures. Output: files for a reader without Python.
"""
