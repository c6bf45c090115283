"""Settings of exports to MATLAB."""

from labcrane import Settings


class MatlabSettings(Settings):
    """Settings of :class:`~labcrane_matlab.matlab.Matlab`."""

    streams: bool = True
    """Whether streams, one row per tick, are written beside movements and events."""
