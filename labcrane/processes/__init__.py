"""Processes of their own, one way for all: session, recorder, feedback, page, doctor's looks.

In comes a module to run and what it is told; out go its messages, and word of its end. What stalls,
crashes or hangs there costs nothing here.
"""
