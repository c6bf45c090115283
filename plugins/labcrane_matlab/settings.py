"""Settings of exports to MATLAB."""

from labcrane import Settings


class MatlabSettings(Settings):
    """Settings of :class:`~labcrane_matlab.matlab.Matlab`."""

    streams: bool = True
    """Whether to write streams, with one row per tick, in addition to movements and events."""
