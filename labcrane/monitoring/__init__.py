"""Monitoring: whether the signals of other programs' streams are alive.

In come samples, from the recorder or from LSL; out go faults, channel by channel, as the monitors
that are installed find them. No monitor runs in the loop or in the recorder.
"""
