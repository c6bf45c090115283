"""Scoring: tests of an operator, the performance indicator of each, and what the indicator weighs.

In come a cohort and the settings of a protocol; out go the tests that `labcrane score` writes.
"""
