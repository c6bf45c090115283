"""The report of a cohort: HTML pages, figures and the evaluation workbook.

In comes a cohort with its measures; out go files for a reader without Python.
"""
