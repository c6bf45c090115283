"""The real-time loop: the whole data flow, in the order it happens."""

from collections.abc import Callable, Sequence

import numpy as np

from labcrane.core.clock import Clock, Tick, tick_of
from labcrane.core.records import Frame, Run
from labcrane.protocol.rig import Rig
from labcrane.recording.frame_log import FrameLog
from labcrane.session.commands import Console, Message
from labcrane.session.sequencer import Sequencer

Forward = Callable[[Frame, float], Frame]
"""Makes the ticks after a frame in which nothing happens, in a run that began at a time; returns
the frame of the last, or the one that it was given."""

Commands = Callable[[], Sequence[Message]]

FrameMaker = Callable[[Tick, Frame, Commands, str | None], Frame]
"""Makes the frame of a tick, from the one that people have seen, orders and the disk's fault."""


def run(
    rig: Rig,
    run: Run,
    sequencer: Sequencer,
    clock: Clock,
    console: Console,
    log: FrameLog,
    sinks: Sequence[Callable[[Frame], None]],
    forward: Forward | None = None,
) -> None:
    """Tick until the session is over.

    Every frame is written to the journal first, and only then shown to the ``sinks``. In a
    simulation, ``forward`` makes the ticks in which nothing happens.
    """
    make_frame = frame_maker(rig, run, sequencer)
    frame = before(rig, run)
    start, number = clock.now(), 0
    while True:
        tick = tick_of(clock, start, number, run.rate_hz)
        frame = make_frame(tick, frame, console.commands, log.trouble)
        log.write(frame)
        for show in sinks:
            show(frame)
        if sequencer.over:
            return
        if forward is not None:
            frame = forward(frame, start)
        number = frame.tick.number + 1


def frame_maker(rig: Rig, run: Run, sequencer: Sequencer) -> FrameMaker:
    """Return the function that makes the frame of a tick; components are looked up once."""
    dt = 1.0 / run.rate_hz
    read, control, rest = rig.input.read, rig.controller.command, rig.controller.idle
    state, step = rig.dynamics.state, rig.dynamics.step
    keep_time, handle, evaluate = sequencer.keep_time, sequencer.handle, sequencer.evaluate
    no_task = np.full(run.task.size, np.nan)

    def make_frame(tick: Tick, seen: Frame, commands: Commands, trouble: str | None) -> Frame:
        axes = read(tick, seen)
        keep_time(tick, seen.tick)
        handle(commands(), rig.input.fault, trouble)
        command = control(axes, state()) if sequencer.moving else rest()
        frame = Frame(tick, 0.0, axes, command, step(command, dt), no_task)
        evaluate(frame)
        return frame

    return make_frame


def before(rig: Rig, run: Run) -> Frame:
    """Return what a person sees before anything has happened."""
    return Frame(
        tick=Tick(-1, 0.0, 0.0),
        elapsed=0.0,
        axes=np.zeros(run.axes.size),
        command=rig.controller.idle(),
        state=rig.dynamics.state(),
        task=np.full(run.task.size, np.nan),
    )
