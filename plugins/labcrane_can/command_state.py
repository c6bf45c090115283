"""Command state: a panel's last command for each joint."""

import math
from dataclasses import dataclass
from typing import Any, Protocol

from labcrane import ProtocolError
from labcrane_can.avc import FULL, FrameError, State, decode
from labcrane_can.dbc import DescribedMessage, FrameKey, described, key_of, of_any_source
from labcrane_can.settings import ValveMap

NODE, PRIORITY_SHIFT = 0xFF, 26


class CanFrame(Protocol):
    """The attributes of python-can's message that are read."""

    arbitration_id: int
    is_extended_id: bool
    is_error_frame: bool
    data: bytearray


@dataclass(slots=True)
class Asked:
    """A joint's last command: its signal, whether the valve is to float, and when it came.

    ``wrong`` describes an invalid value that came since: a panel that sends values other than
    numbers is broken, and its earlier command expires.
    """

    signal: float = 0.0
    floats: bool = False
    time: float = -1e9
    wrong: str = ""


class PanelCommands:
    """Read frames, and keep the last command of every joint.

    Attributes
    ----------
    asked
        By joint, in the order of the settings.
    refused, why
        How many frames could not be obeyed, and the last one's reason in words.
    foreign, passed_by
        How many frames were none of ours, and the last one's identifier in words.
    """

    def __init__(self, settings: ValveMap) -> None:
        self.asked = {joint: Asked() for joint in settings.valves}
        self.refused, self.why, self.foreign, self.passed_by = 0, "", 0, ""
        self._node, self._priority = settings.node, settings.priority
        self._timeout = settings.timeout_s
        self._joints: dict[int, str] = {}
        self._described: dict[FrameKey, DescribedMessage] = {}
        self._neutral, self._full = settings.neutral, settings.full
        self._broken: type[Exception] = FrameError
        if settings.map is None:
            for joint, valve in settings.numbers().items():
                if valve in self._joints:
                    raise ProtocolError(
                        f"joints {self._joints[valve]!r} and {joint!r} have the same valve, "
                        f"{valve}; give each its own"
                    )
                self._joints[valve] = joint
        else:
            from cantools import Error  # noqa: PLC0415 - loads for a moment

            self._described, self._broken = described(settings), Error

    def take(self, frame: CanFrame, time: float) -> None:
        """Take one frame that came at ``time`` in s."""
        if frame.is_error_frame:
            self.refuse("the bus reports an error frame")
        elif self._described:
            self._take_described(frame, time)
        elif not frame.is_extended_id:
            self._pass_by(frame)
        else:
            self._take_valve(frame, time)

    def signals(self, now: float) -> tuple[list[float], list[bool], bool]:
        """Return each joint's signal and float at ``now`` in s, and whether the panel is there."""
        fresh = [now - asked.time <= self._timeout for asked in self.asked.values()]
        pairs = list(zip(self.asked.values(), fresh, strict=True))
        signals = [asked.signal if new and not asked.wrong else 0.0 for asked, new in pairs]
        return signals, [asked.floats and new for asked, new in pairs], any(fresh)

    def silent(self, now: float) -> str | None:
        """Return which valves fell silent at ``now`` in s while they were open, in words.

        Panels may omit shut valves, but silence does not shut a valve. Neither does a value that is
        not a number: it is reported at once.
        """
        if wrong := [asked.wrong for asked in self.asked.values() if asked.wrong]:
            return f"{'; '.join(wrong)}; check the panel"
        fallen = [
            f"{joint} at {asked.signal:g}"
            for joint, asked in self.asked.items()
            if asked.signal != 0.0 and now - asked.time > self._timeout
        ]
        if not fallen:
            return None
        return (
            f"no command for {self._timeout:g} s to a valve that was open: {', '.join(fallen)}; "
            "see what the panel sends, or move that lever again"
        )

    def complaint(self) -> str:
        """Return what came instead of commands, in words; empty when nothing did."""
        parts = []
        if self.refused:
            frames = "1 frame was" if self.refused == 1 else f"{self.refused} frames were"
            parts.append(f"{frames} refused, the last because {self.why}")
        if self.foreign:
            frames = "1 frame was" if self.foreign == 1 else f"{self.foreign} frames were"
            parts.append(f"{frames} not for these valves, the last {self.passed_by}")
        return "; ".join(parts)

    def refuse(self, why: str) -> None:
        """Count something that could not be obeyed, and why."""
        self.refused += 1
        self.why = why

    def forget(self) -> None:
        """Discard all commands from before the bus was lost: the panel sends them again."""
        for asked in self.asked.values():
            asked.signal, asked.floats, asked.wrong, asked.time = 0.0, False, "", -math.inf

    def _pass_by(self, frame: CanFrame) -> None:
        self.foreign += 1
        kind, digits = ("extended", 8) if frame.is_extended_id else ("standard", 3)
        self.passed_by = f"{kind} 0x{frame.arbitration_id:0{digits}X}"

    def _take_valve(self, frame: CanFrame, time: float) -> None:
        try:
            command = decode(frame.arbitration_id, bytes(frame.data))
        except FrameError as error:
            self.refuse(str(error))
            return
        if command is None or command.valve not in self._joints or not self._ours(frame):
            self._pass_by(frame)
            return
        asked = self.asked[self._joints[command.valve]]
        asked.signal, asked.time = float(command.signal), time
        asked.floats = command.state is State.FLOAT
        asked.wrong = ""

    def _take_described(self, frame: CanFrame, time: float) -> None:
        identifier = frame.arbitration_id
        found = self._described.get(key_of(identifier, extended=frame.is_extended_id))
        if found is None and frame.is_extended_id:
            found = self._described.get(of_any_source(identifier))
        if found is None or not self._ours(frame):
            self._pass_by(frame)
            return
        message = found.message
        if len(frame.data) < message.length:
            self.refuse(f"{message.name} has {len(frame.data)} bytes instead of {message.length}")
            return
        try:
            values: Any = message.decode(bytes(frame.data), decode_choices=False)
        except (self._broken, ValueError, LookupError, ArithmeticError, TypeError) as error:
            # cantools raises its own error for a page that the DBC does not list, and what its
            # parts raise
            self.refuse(f"{message.name} cannot be decoded: {error}")
            return
        for joint, signals in found.levers.items():
            if all(signal in values for signal in signals):  # not every frame has multiplexed ones
                given = {f"{message.name}.{signal}": values[signal] for signal in signals}
                self._take_lever(given, joint, time)

    def _take_lever(self, given: dict[str, float], joint: str, time: float) -> None:
        """Take a lever's value and, where that has no sign, its two sides."""
        asked = self.asked[joint]
        (name, value), *sides = given.items()
        share = (float(value) - self._neutral) / (self._full - self._neutral)
        least, side = (0.0, _side(sides)) if sides else (-1.0, 1)
        if isinstance(side, str):
            asked.wrong = side
            self.refuse(side)
        elif not math.isfinite(share):
            asked.wrong = f"{name} is {value}, which is not a number"
            self.refuse(asked.wrong)
        elif not least - 1e-9 <= share <= 1.0 + 1e-9:
            lowest = self._neutral + least * (self._full - self._neutral)
            self.refuse(f"{name} is {value}, beyond {lowest:g} to {self._full:g}")
        else:
            asked.signal, asked.floats, asked.time = float(round(side * share * FULL)), False, time
            asked.wrong = ""

    def _ours(self, frame: CanFrame) -> bool:
        identifier = frame.arbitration_id
        priority = (identifier >> PRIORITY_SHIFT) & 7
        return (self._node is None or identifier & NODE == self._node) and (
            self._priority is None or priority == self._priority
        )


def _side(sides: list[tuple[str, float]]) -> int | str:
    """Return 1 or -1 for the side that a lever is moved to, 0 for rest; else what is wrong.

    The two bits mean: 0 no, 1 yes, 2 an error, 3 not available (SAE J1939-71).
    """
    for name, state in sides:
        if state not in {0, 1}:
            said = {2: "an error", 3: "not available"}.get(int(state), "neither yes nor no")
            return f"{name} is {state:g}, {said}"
    (positive, is_positive), (negative, is_negative) = sides
    if is_positive and is_negative:
        return f"{positive} and {negative} are both 1"
    return int(is_positive) - int(is_negative)
