"""The correction of foreign clocks, and the sync report.

In come stamps, arrivals and clock probes as they were recorded; out go times on this computer's
clock, and how right they are.
"""
