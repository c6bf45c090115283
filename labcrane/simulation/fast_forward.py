"""Fast path of a simulation: compiled kernels compute the ticks in which nothing happens.

It is the loop's law and the loop's bits. Which of the two ran, and why, is noted of every
participant.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec

import numpy as np

from labcrane.core.kernel import Kernel
from labcrane.core.records import Frame, Phase, Run
from labcrane.core.roles import Component, Task
from labcrane.protocol.rig import Rig
from labcrane.recording.frame_log import CODES, LOOP, BatchLog, FrameRow, sizes
from labcrane.session.sequencer import Sequencer

EXTRA = "labcrane[fast]"


@dataclass(frozen=True, slots=True)
class SimulatedBy:
    """How a participant was simulated.

    Attributes
    ----------
    compiled
        Whether by compiled kernels; otherwise by the loop.
    why
        Why not by kernels; with them, the compiler.
    deviation
        Largest allowed difference between a kernel and the loop; 0 for the same bits.
    """

    compiled: bool
    why: str
    deviation: float = 0.0


class FastForward:
    """Computes ticks by kernels, from a frame on; built when the rig is open.

    Parameters
    ----------
    rig, run
        The open rig.
    sequencer
        Knows which trial is under way.
    log
        Where the rows go.
    waiting
        Whether an action waits at the console.

    Attributes
    ----------
    way
        Whether it can, and why not.
    """

    def __init__(
        self,
        rig: Rig,
        run: Run,
        sequencer: Sequencer,
        log: BatchLog,
        waiting: Callable[[], bool],
    ) -> None:
        self._run, self._log = run, log
        self._sequencer, self._waiting = sequencer, waiting
        self._rows = FrameRow(sizes(run))
        self._places = np.cumsum([len(LOOP), *sizes(run)]).astype(np.int64)
        self._seen = np.empty(self._rows.size)
        self._about = np.empty(5)
        self._kernels: tuple[Kernel, ...] = ()
        self._tasks: Mapping[Task, Kernel] = {}
        self.way = self._find(rig)

    def _find(self, rig: Rig) -> SimulatedBy:
        if find_spec("numba") is None:
            return SimulatedBy(compiled=False, why=f"numba is not installed; {EXTRA} brings it")
        from labcrane.simulation.compiled_loop import addresses, advance, same_arithmetic  # noqa: PLC0415

        if not same_arithmetic():
            return SimulatedBy(
                compiled=False, why="compiled arithmetic is not Python's on this computer"
            )
        parts: dict[str, Component] = {
            "operator": rig.input, "scheme": rig.controller, "dynamics": rig.dynamics,
            **{f"task {name!r}": task for name, task in rig.tasks.items()},
        }  # fmt: skip
        kernels = {name: part.kernel() for name, part in parts.items()}
        found = {name: kernel for name, kernel in kernels.items() if kernel is not None}
        if missing := [name for name in kernels if name not in found]:
            return SimulatedBy(compiled=False, why=f"{', '.join(missing)} has no compiled kernel")
        self._advance = advance
        operator, scheme, dynamics, *tasks = found.values()
        self._kernels = (operator, scheme, dynamics)
        self._tasks = dict(zip(rig.tasks.values(), tasks, strict=True))
        self._functions = {
            task: addresses(operator.tick, scheme.inverse, scheme.tick, dynamics.tick, kernel.tick)
            for task, kernel in self._tasks.items()
        }
        most = sum(kernel.changing for kernel in found.values())
        self._kept = np.empty(most)
        compiler = f"numba {version('numba')}"
        return SimulatedBy(
            compiled=True,
            why=compiler,
            deviation=max(kernel.deviation for kernel in found.values()),
        )

    def __call__(self, frame: Frame, start: float) -> Frame:
        """Make the ticks after ``frame``, in a run that began at ``start`` seconds.

        Returns the frame of the last, or ``frame`` when there is none.
        """
        going = self._sequencer.going
        if going is None or not self._kernels or self._waiting():
            return frame
        kernels = (*self._kernels, self._tasks[going.task])
        if not all(kernel.take_over(kernel.own, frame) for kernel in kernels):
            return frame
        number = frame.tick.number + 1
        hands, scheme, machine, task = kernels
        read, inverse, command, step, evaluate = self._functions[going.task]
        self._rows.fill(self._seen, frame)
        self._about[:] = (
            start, self._run.rate_hz, frame.trial, going.ticks, CODES[Phase.RUNNING],
        )  # fmt: skip
        changing = np.array([kernel.changing for kernel in kernels], np.int64)
        last, seen, done = None, self._seen, 0
        while True:
            room = self._log.room
            made = self._advance(
                room, seen, self._places, self._about, self._kept, number + done,
                read, hands.own, inverse, command, scheme.own,
                step, machine.own, evaluate, task.own, changing,
            )  # fmt: skip
            if made:
                for kernel in kernels:
                    kernel.hand_back(kernel.own, room[:made], self._places)
                seen = last = room[made - 1].copy()
                done += made
                self._about[3] += made
                self._log.made(made)
            if made < len(room):
                break
        if last is None:
            return frame
        going.skip(done)
        return self._rows.frame(last)
