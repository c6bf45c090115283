"""Pictures that views showed, and frames that were captured: the streams of their times.

The experimenter's status light rates a view while a session runs, and the tables rate it
afterwards. Both use this one number, so that they agree.
"""

LOG = "labcrane.feedback."
"""Prefix of the streams in which views and sounds log what they presented."""

CAPTURED = "labcrane.capture."
"""Prefix of the streams that list the frames of cameras, microphones and screens."""

TERMS = ("clock", "arrival", "lag")
"""Terms of the uncertainty of a frame's time, as of :class:`labcrane.core.records.Captured`."""

LEVEL = "level"
"""What a film's signal is called: how bright its pictures are, or how loud its sound is."""

CHANNELS = {"frame.number": "1", "file": "1", "pts": "s", **dict.fromkeys(TERMS, "s")}
"""Channels of these streams, with units; ``file`` is the number of the file."""

RATE_S = 1.0
"""The rate of pictures is how many were shown in so many seconds. Over the whole of a movement a
fast part would hide a slow one."""
