"""Pictures of a view: the stream of the times when each was shown, and the span of their rate.

The experimenter's status light rates a view while a session runs, and the tables rate it
afterwards. Both use this one number, so that they agree.
"""

LOG = "labcrane.feedback."
"""Prefix of the streams in which views and sounds log what they presented."""

RATE_S = 1.0
"""The rate of pictures is how many were shown in so many seconds. Over the whole of a movement a
fast part would hide a slow one."""
