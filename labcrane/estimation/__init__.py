"""Estimation of values from streams while a session runs: a process for each estimate.

In come samples of other programs' streams; out goes a stream of values for session and recorder.
"""
