"""Clock probes of liblsl, with the time and the round trip of its own measurement.

pylsl's ``time_correction`` tells the offset alone, so that it can only be paired with the time it
is polled, up to two seconds late. liblsl's ``lsl_time_correction_ex`` tells the rest.
"""

import ctypes
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import pylsl

WAIT_S = 1.0

FASTER = "over a network use a cable, not WiFi; on this computer end programs that are not needed"
"""What makes probes come back sooner, and their round trips alike."""


class Probe(NamedTuple):
    """One measurement of a source's clock, in the order in which it is stored. Seconds.

    Attributes
    ----------
    remote_time
        The source's time at the measurement.
    offset
        What must be added to the source's time to have ours.
    rtt
        Round trip; the offset is wrong by half of it at most.
    local
        Our time when liblsl reported it.
    """

    remote_time: float
    offset: float
    rtt: float
    local: float


class ClockProbe:
    """Asks for the clock offset of an inlet. Not for use by several threads.

    Attributes
    ----------
    newest
        The newest measurement; None before the first.
    """

    def __init__(self, inlet: "pylsl.StreamInlet") -> None:
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded
        from pylsl.lib import lib  # noqa: PLC0415

        self._inlet = inlet
        self._now = pylsl.local_clock
        self._ask = lib.lsl_time_correction_ex
        self._ask.restype = ctypes.c_double
        self.newest: Probe | None = None

    def new(self, wait_s: float = WAIT_S) -> Probe | None:
        """Return the newest measurement; None when there is none since the last call.

        Waits up to ``wait_s`` for the first one, and for the first one after a restart.
        """
        remote, rtt, status = ctypes.c_double(), ctypes.c_double(), ctypes.c_int()
        offset = self._ask(
            self._inlet.obj,
            ctypes.byref(remote),
            ctypes.byref(rtt),
            ctypes.c_double(wait_s),
            ctypes.byref(status),
        )
        if status.value != 0 or (self.newest and remote.value == self.newest.remote_time):
            return None
        self.newest = Probe(remote.value, float(offset), rtt.value, float(self._now()))
        return self.newest
