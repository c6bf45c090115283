"""The recorder: a process that records the streams of other programs.

In come LSL streams; out goes a journal of samples, arrivals and clock probes, and reports of what
is lost, late or back.
"""
