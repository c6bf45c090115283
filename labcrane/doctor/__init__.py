"""Checks a computer before a study day: clock, scheduling, disk, LSL, and the study's devices.

Each check says how something is, whether that will do, and what to do about it.
"""
