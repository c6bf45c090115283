"""A recorded session run again, bit for bit.

In comes a participant file; out goes the same session, and the first number that differs, if any.
"""
