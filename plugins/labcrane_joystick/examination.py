"""Stick examination: identified, centred, moving, and fast enough for a study."""

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median

from labcrane import DeviceError
from labcrane.core import Finding, Verdict
from labcrane.registry import Prompt
from labcrane_joystick import sdl
from labcrane_joystick.calibration import RUN_AGAIN, Calibration, Calibrations, default_path, load
from labcrane_joystick.dual_joystick import tell_apart
from labcrane_joystick.settings import AXES, SIDES, JoystickSettings
from labcrane_joystick.stick import Stick, attached, pair

Look = Callable[[float], float]
"""Wait for the given seconds, let SDL process the sticks' events, and return the time in s."""

HANDS = AXES[:3]
"""The axes that spring back; a slider rests anywhere."""

REST_S, STEP_S = 0.5, 0.005
OFF_CENTRE = 0.04
"""Proportion of full deflection at rest above which a stick is about to leave a dead zone of 5
%."""

STUCK = 0.5
"""Proportion of full deflection at which no working stick rests."""

PUSHED = 0.6
"""Proportion of full deflection that counts as pushed."""

PUSH_S, ROUND_S, POLL_S = 15.0, 5.0, 0.001
REACHED = 0.9
SLOW_HZ = 60.0
"""Changes a second of a moving stick below which movements of a hand are not followed."""

PUSHES = (("to the RIGHT", "x", 1), ("TOWARDS you", "y", 1))


def wait_and_look(seconds: float) -> float:
    """Wait, and take in what the sticks did."""
    import pygame  # noqa: PLC0415 - heavy

    time.sleep(seconds)
    pygame.event.pump()
    return time.perf_counter()


def examine(
    settings: JoystickSettings,
    ask: Prompt | None,
    path: Path | None = None,
    look: Look = wait_and_look,
) -> list[Finding]:
    """Look at the sticks at rest and, when a person is there, while they are moved."""
    sdl.start()
    try:
        where = path or default_path()
        stored = load(where, settings.stick)
        sticks = tell_apart(pair(attached(), settings.stick), stored)
    except DeviceError as error:
        return [Finding.failed(error)]
    else:
        return list(_examined(sticks, stored, ask, look))
    finally:
        sdl.stop()


def _examined(
    sticks: tuple[Stick, Stick], stored: Calibrations | None, ask: Prompt | None, look: Look
) -> Iterator[Finding]:
    both = (stored.left, stored.right) if stored else [Calibration(port=s.port) for s in sticks]
    hands = [Hand(*three) for three in zip(SIDES, sticks, both, strict=True)]
    yield _identity(sticks, stored)
    yield from _at_rest(hands, look)
    if ask is None:
        yield Finding(
            Verdict.WARN,
            "range, direction and rate of the sticks were not checked: no stick was moved",
            "run labcrane doctor --move and follow what it says",
        )
        return
    for hand in hands:
        yield from _pushes(hand, hands, ask, look)
    for hand in hands:
        yield from _rounds(hand, ask, look)


class Hand:
    """A stick and its calibration, on one side."""

    def __init__(self, side: str, stick: Stick, calibration: Calibration) -> None:
        self.side = side
        self._stick = stick
        self._ranges = calibration.axes

    def axes(self) -> list[float]:
        """Return the axes that spring back, in [-1, 1], shape ``(3,)``."""
        raw = zip(self._ranges, self._stick.raw(), strict=True)
        return [scale.scaled(number) for scale, number in raw][: len(HANDS)]


def _identity(sticks: tuple[Stick, Stick], stored: Calibrations | None) -> Finding:
    if stored is None:
        return Finding(
            Verdict.WARN,
            f"two sticks ({sticks[0]}), not identified: the first is used as the left one",
            RUN_AGAIN,
        )
    if not all(stick.has_socket for stick in sticks):
        return Finding(
            Verdict.WARN,
            "this computer does not name its sockets: only the order tells left from right",
            f"{RUN_AGAIN} whenever you plug in a stick again",
        )
    return Finding(
        Verdict.PASS,
        f"left at {sticks[0].port}, right at {sticks[1].port}, calibrated on {stored.date}",
    )


def _at_rest(hands: Sequence[Hand], look: Look) -> Iterator[Finding]:
    seen: list[list[list[float]]] = [[] for _ in hands]
    began = now = look(STEP_S)
    while now - began < REST_S:
        for axes, hand in zip(seen, hands, strict=True):
            axes.append(hand.axes())
        now = look(STEP_S)
    for hand, axes in zip(hands, seen, strict=True):
        for name, values in zip(HANDS, zip(*axes, strict=True), strict=True):
            rest = median(values)
            text = f"{hand.side} {name} rests at {100 * rest:+.1f} % of its range"
            if abs(rest) > STUCK:
                fix = "let go of the stick; if it stays there, it is stuck: unplug it or replace it"
                yield Finding(Verdict.FAIL, text, fix)
            elif abs(rest) > OFF_CENTRE:
                yield Finding(Verdict.WARN, text, f"let go of the stick, or {RUN_AGAIN}")
            else:
                yield Finding(Verdict.PASS, text)


def _pushes(hand: Hand, hands: Sequence[Hand], ask: Prompt, look: Look) -> Iterator[Finding]:
    for where, axis, sign in PUSHES:
        wanted = (hand.side, axis, sign)
        ask(f"push the {hand.side.upper()} stick {where}, and hold it")
        moved = _pushed(hands, look)
        ask("let go of it")
        _released(hands, look)
        if moved is None:
            fix = "the axis is stuck or the stick was not moved: try again, then replace the stick"
            yield Finding(Verdict.FAIL, f"{hand.side} {axis} did not move", fix)
        elif moved == wanted:
            yield Finding(Verdict.PASS, f"{hand.side} {axis} moves as it should")
        else:
            other = f"{moved[0]} {moved[1]} {'+' if moved[2] > 0 else '-'}"
            yield Finding(
                Verdict.FAIL,
                f"{hand.side} stick pushed {where.lower()} moved {other}",
                f"sticks or axes are swapped: {RUN_AGAIN}, or turn the stick to face forward",
            )


def _pushed(hands: Sequence[Hand], look: Look) -> tuple[str, str, int] | None:
    """Wait for a push; return the side, axis and sign that moved most, None when none did."""
    began = now = look(STEP_S)
    while now - began < PUSH_S:
        found = [
            (abs(value), hand.side, name, 1 if value > 0.0 else -1)
            for hand in hands
            for name, value in zip(HANDS, hand.axes(), strict=True)
        ]
        if (most := max(found))[0] > PUSHED:
            return most[1:]
        now = look(STEP_S)
    return None


def _released(hands: Sequence[Hand], look: Look) -> None:
    began = now = look(STEP_S)
    while now - began < PUSH_S and any(abs(v) > STUCK for hand in hands for v in hand.axes()):
        now = look(STEP_S)


def _rounds(hand: Hand, ask: Prompt, look: Look) -> Iterator[Finding]:
    ask(f"for {ROUND_S:.0f} s, move the {hand.side.upper()} stick round along its edge")
    lowest, highest = [0.0] * len(HANDS), [0.0] * len(HANDS)
    changes, last = 0, hand.axes()
    began = now = look(POLL_S)
    while now - began < ROUND_S:
        axes = hand.axes()
        changes += axes != last
        last = axes
        lowest = [min(pair) for pair in zip(lowest, axes, strict=True)]
        highest = [max(pair) for pair in zip(highest, axes, strict=True)]
        now = look(POLL_S)
    for name, low, high in list(zip(HANDS, lowest, highest, strict=True))[:2]:
        text = f"{hand.side} {name} reaches {100 * low:+.0f} to {100 * high:+.0f} % of its range"
        if min(-low, high) >= REACHED:
            yield Finding(Verdict.PASS, text)
        else:
            fix = f"move it to both ends and check again; if it stays so, {RUN_AGAIN}"
            yield Finding(Verdict.FAIL, text, fix)
    rate = changes / (now - began)
    text = f"{hand.side} stick gave {rate:.0f} new values a second while it moved"
    if rate >= SLOW_HZ:
        yield Finding(Verdict.PASS, text)
    else:
        fix = "keep it moving all the time; then try another socket, without a hub"
        yield Finding(Verdict.WARN, text, fix)
