"""Procedure that finds which stick is the left one, and where its axes rest and end."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from statistics import median

from labcrane import DeviceError
from labcrane_joystick.calibration import AxisRange, Calibration, Calibrations
from labcrane_joystick.settings import AXES
from labcrane_joystick.stick import Stick

AT_REST = 100
"""Number of last readings whose median is the centre: half a second."""

LEAST_WAY = 8192
"""Raw numbers an axis must move to each side of its centre, a quarter of its full way."""

Say = Callable[[str], None]
Look = Callable[[], None]
"""Called before each reading of the sticks: wait a little, and let SDL process their events."""


def identify(sticks: Sequence[Stick], say: Say, look: Look) -> tuple[Stick, Stick]:
    """Ask for the triggers, and return the left and the right stick."""
    say("pull the trigger of the LEFT stick")
    left = _wait_for_trigger(sticks, look)
    others = [stick for stick in sticks if stick is not left]
    if len(others) == 1:
        return left, others[0]
    say("pull the trigger of the RIGHT stick")
    return left, _wait_for_trigger(others, look)


def calibrate(sticks: Sequence[Stick], say: Say, look: Look, date: str) -> Calibrations:
    """Take a person through identifying and calibrating two sticks.

    Parameters
    ----------
    sticks
        Of one model, two or more.
    say
        Called with each instruction.
    look
        Called before each look at the sticks.
    date
        Day to be noted, ISO 8601.

    Raises
    ------
    DeviceError
        An axis was not moved far enough to both sides.
    """
    left, right = identify(sticks, say, look)
    found = {}
    for side, stick, other in (("left", left, right), ("right", right, left)):
        say(
            f"move the {side.upper()} stick to all its ends, twist it both ways, move its slider "
            "to both ends; then let go of it and pull the trigger of the other stick"
        )
        found[side] = Calibration(port=stick.port, **_ranges(stick, other, side, look))
    return Calibrations(date=date, left=found["left"], right=found["right"])


def _wait_for_trigger(sticks: Sequence[Stick], look: Look) -> Stick:
    """Return the stick whose trigger is pulled next, after a look at which none was."""
    quiet = False
    while True:
        look()
        pulled = [stick for stick in sticks if stick.trigger()]
        if quiet and len(pulled) == 1:
            return pulled[0]
        quiet = not pulled


def _ranges(stick: Stick, other: Stick, side: str, look: Look) -> Mapping[str, AxisRange]:
    """Watch the axes until the other stick's trigger is pulled."""
    lowest = highest = stick.raw()
    recent = deque([lowest], maxlen=AT_REST)
    released = False
    while not (released and other.trigger()):
        released |= not other.trigger()
        look()
        raw = stick.raw()
        lowest = [min(both) for both in zip(lowest, raw, strict=True)]
        highest = [max(both) for both in zip(highest, raw, strict=True)]
        recent.append(raw)
    rest = [round(median(axis)) for axis in zip(*recent, strict=True)]
    # A slider stays where it is left, so its centre is the middle.
    rest[-1] = (lowest[-1] + highest[-1]) // 2
    return {
        name: _range(f"{side} {name}", *numbers)
        for name, *numbers in zip(AXES, lowest, rest, highest, strict=True)
    }


def _range(axis: str, lowest: int, rest: int, highest: int) -> AxisRange:
    if min(rest - lowest, highest - rest) < LEAST_WAY:
        raise DeviceError(
            f"{axis} was moved from {lowest} to {highest} and rests at {rest} (raw), but must "
            f"move by {LEAST_WAY} at least to each side; start again and move it to both ends"
        )
    return AxisRange(minimum=lowest, centre=rest, maximum=highest)
