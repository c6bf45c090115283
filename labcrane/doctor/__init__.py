"""Checks of a computer before a study day.

Input: a protocol, or none. Output: findings with verdicts and remedies.
"""
