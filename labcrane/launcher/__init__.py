"""The launcher of a run: starts, watches and restarts its processes.

In comes what to run; out go processes, their reports, and a finished recording.
"""
