"""Triggers: pulses that report a session's events to other devices, tick by tick."""

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager

from labcrane.core.events import PULSES
from labcrane.core.records import Echo, Event, Frame, Run, Value
from labcrane.core.roles import Trigger
from labcrane.errors import PluginError
from labcrane.limits import LIMITS

SENT, UNSENT, ECHO = "trigger.sent", "trigger.unsent", "trigger.echo"
LOST, BACK = "trigger.lost", "trigger.back"
FLOOD = "trigger.flood"
HIGHEST = 255
"""Eight lines carry no more."""

LAST_S, BETWEEN_S = 0.25, 0.005
"""How long the last codes of a session and their echoes are waited for, and how long between two
looks."""

STALE_S = 1.0
"""A code that has waited for so long behind others is not sent any more: it would be taken for the
moment at which it comes."""

WAITING = 64
"""Codes that are waited for at most; a line without echoes is waited for in vain."""

LOOKED_AT = LIMITS["trigger echo"].most
"""Codes of a tick that are looked at; a device that sends more is broken, or a different one."""

STRAYS = 20
"""Codes a second that were never sent, and are written down all the same."""

LEAST_REST = 0.125
"""Part of the spacing for which a line rests at least: 2.5 ms by default, which a device with 500
samples a second sees. A tick that is late clears the line late."""


class _Line:
    """One trigger, and what was sent on it."""

    def __init__(self, name: str, trigger: Trigger) -> None:
        self.name = name
        self.trigger = trigger
        self.codes = PULSES if trigger.codes is None else trigger.codes
        self.urgency = {event: number for number, event in enumerate(self.codes)}
        wrong = {event: code for event, code in self.codes.items() if not 1 <= code <= HIGHEST}
        if wrong:
            event, code = next(iter(wrong.items()))
            raise PluginError(
                f"trigger {name!r} has the code {code} for {event!r}; a code is 1 to {HIGHEST}"
            )
        self.fault: str | None = None
        self.answers = False
        self.queue: deque[tuple[int, float]] = deque()
        self.rested, self.shown_until, self.free_at = True, -math.inf, -math.inf
        self.waiting: deque[tuple[int, float]] = deque(maxlen=WAITING)
        self.strays = STRAYS
        self.left_out = 0
        self.second: int | None = None

    def take(self, frame: Frame) -> None:
        """Let the codes of a frame's events wait for their turn, the most urgent before others."""
        wanted = sorted(
            (one.name for one in frame.events if one.name in self.codes), key=self._rank
        )
        self.queue.extend((self.codes[name], frame.tick.due) for name in wanted)

    @property
    def awaits_echoes(self) -> bool:
        """Whether echoes of what was sent are still to come."""
        return self.answers and bool(self.waiting)

    def _rank(self, event: str) -> int:
        return self.urgency[event]

    def next(self, now: float) -> tuple[int, float] | None:
        """Return the code whose turn it is, and when its tick was due; None where the line rests.

        A device that samples its lines sees two codes only with a rest between. A line that shows a
        code for the first half of its spacing is cleared in the first tick behind that.
        """
        if not self.rested and now >= self.shown_until:
            self.rested = True
            self.free_at = max(self.free_at, now + LEAST_REST * self.trigger.spacing_s)
            return None
        if not (self.queue and self.rested and now >= self.free_at):
            return None
        self.rested = False
        self.shown_until = now + self.trigger.spacing_s / 2.0
        self.free_at = now + self.trigger.spacing_s
        return self.queue.popleft()


class Triggers:
    """Sends what happened in a frame to every trigger, and notes when, and what came back.

    Of the codes of one tick the first goes out in it, and the others one at a time in ticks that
    follow, as soon as the device can show them.

    Parameters
    ----------
    lines
        Open triggers, by the protocol's names for them.
    note
        Writes an event into the record that was found out after a tick, of that number.
    tell
        Reports an event to the experimenter.
    """

    def __init__(
        self,
        lines: Mapping[str, Trigger],
        note: Callable[[Event, int], None],
        tell: Callable[[Event], None],
    ) -> None:
        self._lines = [_Line(name, trigger) for name, trigger in lines.items()]
        self._note = note
        self._tell = tell
        self._tick = 0

    def __call__(self, frame: Frame) -> None:
        """Send what is due of the codes of events. Does not wait for any device."""
        self._tick = frame.tick.number
        for line in self._lines:
            line.take(frame)
            self._send(line, frame.tick.due)
            self._leave_out(line, frame.tick.due, STALE_S)
            self._tell_of_flood(line, frame.tick.due)
            self._look(line, frame)

    def _send(self, line: _Line, due: float) -> None:
        """Send the code whose turn it is, if there is any, and take what has come back."""
        began = time.perf_counter()
        turn = line.next(began)
        echoes = line.trigger.send([] if turn is None else [turn[0]], began)
        sent, fault = time.perf_counter(), line.trigger.fault
        if turn is not None:
            code, since = turn
            if fault is None:
                line.waiting.append((code, began))
                self._write(SENT, due, line, {"codes": str(code), "delay_s": sent - since})
            else:
                self._write(UNSENT, due, line, {"codes": str(code), "why": fault})
        self._take(line, echoes)

    def _leave_out(self, line: _Line, now: float, longest_s: float) -> None:
        """Note codes that have waited for so long that they would say nothing any more."""
        while line.queue and now - line.queue[0][1] > longest_s:
            code, _ = line.queue.popleft()
            why = "more codes than the line can show one after another"
            self._write(UNSENT, now, line, {"codes": str(code), "why": why})

    def finish(self) -> None:
        """Wait a moment for what is still under way, after the last tick."""
        until = time.perf_counter() + LAST_S
        while waiting := [each for each in self._lines if each.queue or each.awaits_echoes]:
            if time.perf_counter() >= until:
                break
            time.sleep(BETWEEN_S)
            for line in waiting:
                self._send(line, time.perf_counter())
        for line in self._lines:
            self._leave_out(line, time.perf_counter(), -math.inf)
            line.second = -1
            self._tell_of_flood(line, time.perf_counter())

    def _take(self, line: _Line, echoes: Sequence[Echo]) -> None:
        """Note what came back; of codes that nobody sent, so many as a record can bear."""
        for echo in echoes[:LOOKED_AT]:
            line.answers = True
            delay_s = _delay(line.waiting, echo.code, echo.time)
            if delay_s is None and line.strays <= 0:
                line.left_out += 1
                continue
            line.strays -= delay_s is None
            self._write(ECHO, echo.time, line, {"code": echo.code, "delay_s": delay_s})
        line.left_out += max(0, len(echoes) - LOOKED_AT)

    def _tell_of_flood(self, line: _Line, now: float) -> None:
        """Say once a second how many codes were left out."""
        if line.second is None:
            line.second = int(now)
        if int(now) == line.second:
            return
        line.second, line.strays = int(now), STRAYS
        if line.left_out:
            why = f"{line.name} sent {line.left_out} unexpected codes; they are left out"
            line.left_out = 0
            self._tell(self._write(FLOOD, now, line, {"why": why}))

    def _look(self, line: _Line, frame: Frame) -> None:
        """Say once that a line is lost, and once that it is back."""
        fault = line.trigger.fault
        if (fault is None) == (line.fault is None):
            return
        line.fault = fault
        name, data = (BACK, {}) if fault is None else (LOST, {"why": f"{line.name}: {fault}"})
        self._tell(self._write(name, frame.tick.due, line, data))

    def _write(
        self,
        name: str,
        when: float,
        line: _Line,
        data: Mapping[str, Value],
    ) -> Event:
        event = Event(name, when, {"trigger": line.name, **data})
        self._note(event, self._tick)
        return event


def _delay(waiting: deque[tuple[int, float]], code: int, came: float) -> float | None:
    """Return how long after it was to be sent a code came back, in seconds; None for none of ours.

    Whatever was sent before it and has not come back by now is lost.
    """
    for at, (each, sent) in enumerate(waiting):
        if each == code:
            for _ in range(at + 1):
                waiting.popleft()
            return came - sent
    return None


@contextmanager
def opened(lines: Mapping[str, Trigger], run: Run) -> Iterator[Mapping[str, Trigger]]:
    """Open triggers, and close them however that ends."""
    with ExitStack() as closing:
        for trigger in lines.values():
            closing.callback(trigger.close)
            trigger.open(run)
        yield lines
