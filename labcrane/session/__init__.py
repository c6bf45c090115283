"""One session in one process: the loop, and the sequencer that leads it.

In come axes, commands and answers; out go frames and events, to the journal first.
"""
