"""Contract of compiled kernels: the same numbers as their component, tick by tick."""

from collections.abc import Callable
from functools import cache

import numpy as np

from labcrane.core.kernel import MADE, Kernel, Places
from labcrane.core.records import Frame, Run, Trial
from labcrane.core.roles import Component, Controller, Dynamics, InputDevice, Task
from labcrane.recording.frame_log import LOOP, FrameRow, sizes
from labcrane.testing.presentation import TARGETS
from labcrane.testing.roles import (
    STICKS,
    ch8,
    crane_at,
    crane_state,
    make_frame,
    make_run,
    make_trial,
    opened,
)
from labcrane.types import FloatArray

TICKS = 400
MOST_DECLINED = 0.5
"""Share of ticks that a kernel may decline: with more it saves nothing."""


class KernelContract:
    """What every kernel must do. Provide the fixture ``component``: built, and not yet open.

    It is an input device, a controller, a machine or a task, and needs numba.
    """

    def test_kernel_makes_its_components_numbers_tick_by_tick(self, component: Component) -> None:
        run = _run(component)
        with opened(component, run):
            trial = _trial(component)
            component.begin_trial(trial)
            kernel = component.kernel()
            name = type(component).__name__
            assert kernel is not None, f"{name}.kernel() returns None: it has none to be checked"
            declined = _compare(component, kernel, run)
            assert declined <= MOST_DECLINED * TICKS, f"it declined {declined} of {TICKS} ticks"


def _run(component: Component) -> Run:
    machine, inverse = ch8(), _hands_of
    match component:
        case InputDevice():
            return make_run(machine, axes=component.signals, task=TARGETS, inverse=inverse)
        case Controller():
            return make_run(machine, command=component.signals)
        case Dynamics():
            return make_run(machine, state=component.signals)
        case _:
            state = crane_state(machine).signals
            return make_run(machine, axes=STICKS, state=state, task=component.signals)


def _trial(component: Component) -> Trial:
    if isinstance(component, Task):
        return make_trial(component.plan(component.factors())[0])
    return make_trial()


def _hands_of(velocity: FloatArray, state: FloatArray) -> FloatArray:
    axes = np.zeros(12)
    axes[:3] = velocity
    return axes


def _compare(component: Component, kernel: Kernel, run: Run) -> int:
    """Compare tick by tick; return how many were declined."""
    places = np.cumsum([len(LOOP), *sizes(run)]).astype(np.int64)
    rows = FrameRow(sizes(run))
    row, seen_row = np.empty(rows.size), np.empty(rows.size)
    column = (InputDevice, Controller, Dynamics, Task)
    part = [isinstance(component, role) for role in column].index(True)
    mine = slice(int(places[part]), int(places[part + 1]))
    random, declined = np.random.default_rng(1), 0
    seen, ready = _frames(run, random)(0), False
    frame_of = _frames(run, random)
    for number in range(1, TICKS + 1):
        frame = frame_of(number)
        rows.fill(seen_row, seen)
        rows.fill(row, frame)
        if not ready:
            ready = kernel.take_over(kernel.own, seen)
        kept = kernel.own[: kernel.changing].copy()
        made = ready and _tick(component, kernel, places, seen_row, row) == MADE
        wanted, plain = _make(component, frame, seen, run)
        if made:
            assert plain, f"in tick {number} something happened, and the kernel did not decline"
            _check(row[mine], wanted, kernel.deviation, number)
        else:
            declined += 1
            kernel.own[: kernel.changing], ready = kept, False
        seen = frame
    return declined


def _frames(run: Run, random: np.random.Generator) -> Callable[[int], Frame]:
    """Return what makes frames of a machine that wanders about its rest."""
    angles = np.array(run.machine.rest)
    low, high = np.array(run.machine.limits).T

    def frame(number: int) -> Frame:
        nonlocal angles
        angles = np.clip(angles + random.normal(0.0, 0.01, len(angles)), low, high)
        crane = crane_at(run.machine, angles.tolist())
        made = make_frame(run, number, np.pad(crane, (0, run.state.size - crane.size)))
        made.axes = random.uniform(-1.0, 1.0, run.axes.size)
        made.command = random.uniform(-0.05, 0.05, run.command.size)
        if run.task.size:
            made.task = np.linspace(2.0, 5.0, run.task.size)
        return made

    return frame


def _tick(
    component: Component, kernel: Kernel, places: Places, seen: FloatArray, row: FloatArray
) -> int:
    if not isinstance(component, InputDevice):
        return int(kernel.tick(kernel.own, places, seen, row))
    return int(kernel.tick(kernel.own, places, seen, row, _stand_in(), np.empty(0)))


@cache
def _stand_in() -> object:
    from labcrane.core.compiled import inverse  # noqa: PLC0415 - loads numba

    return inverse(_compiled_hands)


def _compiled_hands(
    own: FloatArray, places: Places, velocity: FloatArray, seen: FloatArray, row: FloatArray
) -> int:
    at = places[0]
    row[at : places[1]] = 0.0
    row[at], row[at + 1], row[at + 2] = velocity[0], velocity[1], velocity[2]
    return 0


def _make(component: Component, frame: Frame, seen: Frame, run: Run) -> tuple[FloatArray, bool]:
    """Return what the component makes of a tick, and whether nothing happened in it."""
    match component:
        case InputDevice():
            return component.read(frame.tick, seen), True
        case Controller():
            return component.command(frame.axes, seen.state), True
        case Dynamics():
            return component.step(frame.command, 1.0 / run.rate_hz), True
        case Task():
            status = component.evaluate(frame)
            if status.phase.over:
                component.begin_trial(_trial(component))
            return status.values, not status.events and not status.phase.over
    raise AssertionError(f"{type(component).__name__} makes no ticks")


def _check(got: FloatArray, wanted: FloatArray, deviation: float, number: int) -> None:
    same = got.tobytes() == np.ascontiguousarray(wanted).tobytes()
    if not same and not (deviation and np.abs(got - wanted).max() <= deviation):
        off = float(np.abs(got - wanted).max())
        raise AssertionError(
            f"in tick {number} the kernel made {got}, and the component {wanted}: {off:.3g} apart"
        )
