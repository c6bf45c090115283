"""One stream under its monitors: what is wrong with it, and since when."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from labcrane.core.roles import SignalMonitor
from labcrane.core.signals import SignalChannel, SignalFault, SignalStream
from labcrane.recording.xdf.header import StreamHeader
from labcrane.types import FloatArray


@dataclass(frozen=True, slots=True)
class SignalChange:
    """A fault that has just been found, or that is there no more."""

    fault: SignalFault
    bad: bool


class MonitoredStream:
    """Gives samples to the monitors of one stream, and notes what changes.

    Whatever a monitor raises ends that monitor, and is said; the others go on.

    Attributes
    ----------
    faults
        What is wrong now.
    failed
        Why a monitor was left out, by its name.
    """

    def __init__(self, stream: SignalStream, monitors: Mapping[str, SignalMonitor]) -> None:
        self.faults: tuple[SignalFault, ...] = ()
        self.failed: dict[str, str] = {}
        self.stream = stream
        self._monitors = dict(monitors)
        self._now: dict[tuple[str, str], SignalFault] = {}

    @property
    def monitors(self) -> tuple[str, ...]:
        """The names of those that look at it."""
        return tuple(self._monitors)

    @property
    def watched(self) -> bool:
        """Whether any monitor looks at it."""
        return bool(self._monitors)

    def look(self, times: FloatArray, samples: FloatArray) -> list[SignalChange]:
        """Take the next samples, ``(n,)`` and ``(n, n_channels)``; return what has changed."""
        now: dict[tuple[str, str], SignalFault] = {}
        for name, monitor in list(self._monitors.items()):
            try:
                with np.errstate(all="ignore"):  # sources send whatever they like
                    found = list(monitor.look(times, samples))
                now |= {(fault.channel, fault.kind): fault for fault in found}
            except Exception as error:  # noqa: BLE001 - a plugin may raise anything
                self.failed[name] = f"{type(error).__name__}: {error}"
                del self._monitors[name]
        changes = [
            SignalChange(fault, bad=True) for key, fault in now.items() if key not in self._now
        ]
        changes += [
            SignalChange(fault, bad=False) for key, fault in self._now.items() if key not in now
        ]
        self._now, self.faults = now, tuple(now.values())
        return changes


def signal_stream(header: StreamHeader) -> SignalStream:
    """Return the description of a stream that monitors receive."""
    channels = tuple(SignalChannel(each.label, each.unit, each.type) for each in header.channels)
    return SignalStream(header.name, header.type, header.rate_hz, channels)
