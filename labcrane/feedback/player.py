"""Player of a movement: to views and sounds as a session does, in real time."""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from labcrane.core.clock import Tick
from labcrane.core.records import Event, Frame, Run, Value
from labcrane.errors import DeviceError
from labcrane.feedback.handle import FeedbackHandle
from labcrane.feedback.processes import host_orders
from labcrane.machines.scene_codec import SCENE_PLACED
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study

LOOK_S = 0.05
PATIENCE_S = 10.0
"""How long to wait until all that are ready have presented the first frame."""

HOLD_S = 1.5
"""Minimum duration of the first frame."""

END_S = 1.0
"""Duration of the last frame."""


def play(study: Study, frames: Sequence[Frame], scene: str, say: Callable[[str], None]) -> None:
    """Show and sound consecutive frames with everything switched on.

    Parameters
    ----------
    scene
        The scene, see :func:`labcrane.machines.read_placed`.
    say
        Reports progress.

    Raises
    ------
    DeviceError
        No view and no sound of the study can be started here.
    """
    run = Rig.build(study, simulated=True).describe(study, participant_seed=0)
    source = f"{study.protocol.study}/preview-{os.getpid()}"
    orders = [replace(order, recorded=False) for order in host_orders(study, run, source)]
    handles = [FeedbackHandle(order, "continue") for order in orders]
    try:
        wait_for_all(handles, say, "--out FOLDER writes files instead")
        _present(run, source, frames, scene, [*study.cues, *study.sounds], handles)
    finally:
        for handle in handles:
            handle.stop()


def wait_for_all(
    handles: Sequence[FeedbackHandle], say: Callable[[str], None], instead: str
) -> None:
    """Wait until each is ready or left out.

    Raises
    ------
    DeviceError
        All are left out; its message ends with ``instead``, a remedy.
    """
    while not all(handle.ready or handle.given_up for handle in handles):
        for handle in handles:
            for news in handle.watch():
                say(f"feedback {news}")
        time.sleep(LOOK_S)
    if all(handle.given_up for handle in handles):
        raise DeviceError(f"nothing can be shown or sounded here; {instead}")


def _present(
    run: Run,
    source: str,
    frames: Sequence[Frame],
    scene: str,
    active: Sequence[str],
    handles: Sequence[FeedbackHandle],
) -> None:
    from labcrane.streams.context import ContextOutlet  # noqa: PLC0415 - loads liblsl
    from labcrane.streams.frames import FrameOutlet  # noqa: PLC0415

    outlets = (FrameOutlet(run, source), ContextOutlet(run, source))
    show = partial(_send, [outlet.push for outlet in outlets])
    try:
        first, now = frames[0], time.perf_counter()
        about: dict[str, Value] = {"trial": first.trial, "feedback": "+".join(active) or "none"}
        placed = Event(SCENE_PLACED, now, {"things": scene})
        show(first, placed, Event("trial.start", now, about))
        hold(lambda: show(first), handles)
        began = time.perf_counter()
        for frame in frames:
            due = began + frame.tick.due - first.tick.due
            time.sleep(max(0.0, due - time.perf_counter()))
            show(frame)
        time.sleep(END_S)
    finally:
        for outlet in outlets:
            outlet.close()


def _send(pushes: Sequence[Callable[[Frame], None]], frame: Frame, *events: Event) -> None:
    """Send a frame with the present time."""
    now = time.perf_counter()
    sent = replace(frame, tick=Tick(frame.tick.number, now, now), events=events)
    for push in pushes:
        push(sent)


def hold(show: Callable[[], None], handles: Sequence[FeedbackHandle]) -> None:
    """Show the first frame until all present it, and for a while.

    Programs that find the streams now learn within a second what is switched on.
    """
    began = time.perf_counter()
    while (now := time.perf_counter()) < began + HOLD_S or not (
        all(handle.presented or handle.given_up for handle in handles) or now > began + PATIENCE_S
    ):
        show()
        time.sleep(LOOK_S)
