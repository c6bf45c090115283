"""Drive from valve signals to joint speeds: dead time, opening, and the model's speed."""

import math
from collections import deque
from collections.abc import Sequence

from labcrane import Machine, ProtocolError
from labcrane_dmd.model.interpolation import FULL
from labcrane_dmd.model.model import Model, SegmentModel, Valve

SHUT = 0.25
"""Opening, in steps of 0.4 %, that is none: a lag never quite gets there."""


class SegmentDrive:
    """One joint's valve.

    The signal waits for the dead time of its direction; what of it is beyond the dead band is the
    valve's opening, which follows with a first-order lag; the joint then moves at the speed that
    the model has for the signal of that opening (docs/decisions/0050).
    """

    def __init__(self, segment: SegmentModel, dt: float) -> None:
        self._segment = segment
        self._directions = (segment.extend, segment.retract)
        self._longest = max(round(each.dead_time / dt) for each in self._directions)
        self._delays = [round(each.dead_time / dt) for each in self._directions]
        self._shares = [
            1.0 - math.exp(-dt / each.lag) if each.lag else 1.0 for each in self._directions
        ]
        self.reset()

    def reset(self) -> None:
        """Forget every signal: the valve is shut."""
        self._waiting = deque([0.0] * (self._longest + 1), maxlen=self._longest + 1)
        self._opening = 0.0
        self.signal = 0.0

    def speed(self, signal: float, angle: float) -> float:
        """Return the speed in rad/s for a tick with this signal, at ``angle`` in rad."""
        self._waiting.append(signal)
        which = 1 if signal < 0.0 or (signal == 0.0 and self._opening < 0.0) else 0
        wanted = self._beyond(self._waiting[-1 - self._delays[which]])
        self._opening += self._shares[which] * (wanted - self._opening)
        self.signal = self._closed(self._opening)
        return self._segment.speed(self.signal, angle)

    def _beyond(self, signal: float) -> float:
        beyond = abs(signal) - self._segment.direction(signal).dead_band
        return math.copysign(beyond, signal) if beyond > 0.0 else 0.0

    def _closed(self, opening: float) -> float:
        if abs(opening) < SHUT:
            return 0.0
        size = abs(opening) + self._segment.direction(opening).dead_band
        return math.copysign(min(size, FULL), opening)


def drives(
    model: Model,
    proportional: Sequence[str],
    machine: Machine,
    dt: float,
    valve: Valve | None = None,
) -> tuple[SegmentDrive, ...]:
    """Return a drive for every joint of the machine.

    Proportional ones have the dead band, dead time and lag of ``valve``, or the model's on average.

    Raises
    ------
    ProtocolError
        A joint is neither in the model nor proportional, or is both.
    """
    found: list[SegmentDrive] = []
    for name in proportional:
        if name not in machine.names:
            raise ProtocolError(
                f"proportional names joint {name!r}; the machine has {', '.join(machine.names)}"
            )
    for joint in machine.joints:
        if joint.name in proportional:
            found.append(SegmentDrive(model.proportional(joint, valve), dt))
        elif joint.name in model:
            found.append(SegmentDrive(model[joint.name], dt))
        else:
            raise ProtocolError(
                f"joint {joint.name!r} is not in the model, which has {', '.join(model)}; list it "
                "under proportional, or record and fit it"
            )
    return tuple(found)
