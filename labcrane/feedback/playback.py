"""Playback of a recorded session: its own frames to views and sounds, at any speed."""

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from labcrane.core.clock import Tick
from labcrane.core.records import Event, Frame, Run
from labcrane.errors import DeviceError, RecordingError
from labcrane.feedback.handle import FeedbackHandle
from labcrane.feedback.player import END_S, hold, wait_for_all
from labcrane.feedback.processes import host_orders
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study
from labcrane.recording.participant_file.reader import SessionRecord
from labcrane.recording.recorded_frames import RecordedFrames


def played(
    recorded: RecordedFrames,
    start_s: float,
    speed: float,
    now: Callable[[], float],
    rest: Callable[[float], None],
) -> Iterator[tuple[Frame, list[Event]]]:
    """Yield each frame when it is due, and the events since the last one.

    Parameters
    ----------
    start_s
        The second to begin at; earlier events come with the first frame.
    now, rest
        A clock in seconds, and a function that waits for a number of seconds.

    Raises
    ------
    RecordingError
        The session has no such second.
    """
    length = float(recorded.time[-1] - recorded.time[0]) if len(recorded.time) else 0.0
    if not 0.0 <= start_s <= length:
        raise RecordingError(
            f"the session lasts {length:.1f} s and has no second {start_s:g}; give one from 0 on"
        )
    begun, origin = now(), recorded.time[0] + start_s
    row, told = int(np.searchsorted(recorded.time, origin - 1e-9)), -1
    while True:
        frame = recorded.frame(row)
        yield frame, recorded.events(told, row)
        told = row
        if row + 1 >= len(recorded.time):
            return
        rest(max(0.0, (recorded.time[row + 1] - origin) / speed - (now() - begun)))
        reached = origin + (now() - begun) * speed
        row = max(row + 1, int(np.searchsorted(recorded.time, reached + 1e-9)) - 1)


def play(
    study: Study,
    record: SessionRecord,
    *,
    speed: float,
    start_s: float,
    say: Callable[[str], None],
) -> None:
    """Show and sound a recorded session in the views and sounds of its study.

    Nothing is simulated again: it shows the recorded numbers, with the cues, the settings and
    the scene of each moment.

    Raises
    ------
    DeviceError
        The study has neither views nor sounds, or none can be started here.
    RecordingError
        The session has no second ``start_s``.
    """
    if not (study.views or study.sounds):
        raise DeviceError(
            "the study has neither views nor sounds, so nothing can be shown; labcrane view shows "
            "any session in a browser"
        )
    recorded = RecordedFrames(record)
    run = _run_of(study, recorded)
    source = f"{study.protocol.study}/replay-{os.getpid()}"
    orders = [replace(order, recorded=False) for order in host_orders(study, run, source)]
    handles = [FeedbackHandle(order, "continue") for order in orders]
    try:
        wait_for_all(handles, say, "labcrane view shows any session in a browser")
        _send_all(run, source, recorded, handles, speed=speed, start_s=start_s)
    finally:
        for handle in handles:
            handle.stop()


def _run_of(study: Study, recorded: RecordedFrames) -> Run:
    run = Rig.build(study, simulated=True).describe(study, participant_seed=0)
    return replace(run, axes=recorded.axes)  # the recording may have used other controls


def _send_all(
    run: Run,
    source: str,
    recorded: RecordedFrames,
    handles: list[FeedbackHandle],
    *,
    speed: float,
    start_s: float,
) -> None:
    from labcrane.streams.context import ContextOutlet  # noqa: PLC0415 - loads liblsl
    from labcrane.streams.frames import FrameOutlet  # noqa: PLC0415

    outlets = (FrameOutlet(run, source), ContextOutlet(run, source))

    def send(frame: Frame, events: list[Event]) -> None:
        at = time.perf_counter()
        stamped = tuple(replace(event, time=at) for event in events)
        now = replace(frame, tick=Tick(frame.tick.number, at, at), events=stamped)
        for outlet in outlets:
            outlet.push(now)

    try:
        first, events = next(played(recorded, start_s, speed, time.perf_counter, time.sleep))
        send(first, events)
        hold(lambda: send(first, []), handles)
        shown = played(recorded, start_s, speed, time.perf_counter, time.sleep)
        send(next(shown)[0], [])  # events until then were sent
        for frame, happened in shown:
            send(frame, happened)
        time.sleep(END_S)
    finally:
        for outlet in outlets:
            outlet.close()
