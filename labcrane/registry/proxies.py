"""Components under oversight: the same methods, and every call is watched."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from labcrane.core.records import TrialStatus
from labcrane.core.roles import Component, Controller, Dynamics, InputDevice, Questionnaire, Task
from labcrane.core.signals import Layout
from labcrane.errors import PluginError
from labcrane.registry.call_monitor import CallMonitor
from labcrane.registry.registry import ROLES

if TYPE_CHECKING:
    from labcrane.core.clock import Tick
    from labcrane.core.items import Answers, Item
    from labcrane.core.records import Frame, PlannedTrial, Run, Trial, Value
    from labcrane.machines.machine import Body
    from labcrane.types import FloatArray


def watched(component: Component, name: str, plugin: str, oversight: CallMonitor) -> Component:
    """Return ``component`` under oversight; what runs in a process of its own as it is."""
    for role, made in WATCHED.items():
        if isinstance(component, role):
            return made(component, f"{ROLES[role].word} {name!r}", plugin, oversight)
    return component


@contextmanager
def hurried(components: Iterable[Component]) -> Iterator[None]:
    """Watch what runs every tick less closely: whether it keeps its word, not when and where.

    For simulations. Nobody waits for a tick of theirs, and one that dies is made again.
    """
    hasty = [component for component in components if isinstance(component, _Watched)]
    for component in hasty:
        vars(component).update(component.brisk())
    try:
        yield
    finally:
        for component in hasty:
            for method in component.brisk():
                delattr(component, method)


class _Watched(Component):
    """What every role has."""

    def __init__(self, component: Any, called: str, plugin: str, oversight: CallMonitor) -> None:
        self._inner = component
        self._oversight = oversight
        self._call = oversight.call
        self._number = {
            method: oversight.place(called, plugin, method, getattr(component, method))
            for method in dir(type(self))
            if not method.startswith("_") and callable(getattr(component, method, None))
        }
        self._layout = Layout(called, component.signals)
        for attribute in ("signals", "results", "condition_units", "title", "rights", "scores"):
            if hasattr(component, attribute):
                setattr(self, attribute, getattr(component, attribute))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["_inner"], name)

    def open(self, run: Run) -> None:
        self._call(self._number["open"], self._inner.open, run)

    def begin_trial(self, trial: Trial) -> None:
        self._call(self._number["begin_trial"], self._inner.begin_trial, trial)

    def close(self) -> None:
        self._call(self._number["close"], self._inner.close)

    def metadata(self) -> Mapping[str, Value]:
        facts: Mapping[str, Value] = self._call(self._number["metadata"], self._inner.metadata)
        return facts

    def brisk(self) -> Mapping[str, Callable[..., Any]]:
        """Return the methods that run every tick, by name, watched less closely."""
        return {}

    def _brisk(self, method: str, layout: Layout | None = None) -> Callable[..., Any]:
        return self._oversight.brisk(self._number[method], getattr(self._inner, method), layout)

    def _checked(self, number: int, values: FloatArray) -> FloatArray:
        self._oversight.check(number, values, self._layout, finite=True)
        return values


class WatchedInput(_Watched, InputDevice):
    """An input device; the first that a tick enters."""

    @property
    def fault(self) -> str | None:  # type: ignore[override]  # nobody but the device sets it
        fault: str | None = self._inner.fault
        return fault

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        self._oversight.begin_tick(tick.number)
        number = self._number["read"]
        return self._checked(number, self._call(number, self._inner.read, tick, seen))

    def brisk(self) -> Mapping[str, Callable[..., Any]]:
        begin_tick, read = self._oversight.begin_tick, self._brisk("read", self._layout)

        def begin(tick: Tick, seen: Frame) -> FloatArray:
            begin_tick(tick.number)
            values: FloatArray = read(tick, seen)
            return values

        return {"read": begin}


class WatchedController(_Watched, Controller):
    """A controller."""

    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        number = self._number["command"]
        return self._checked(number, self._call(number, self._inner.command, axes, state))

    def idle(self) -> FloatArray:
        number = self._number["idle"]
        return self._checked(number, self._call(number, self._inner.idle))

    def inverse(self, velocity: FloatArray, state: FloatArray) -> FloatArray:
        axes: FloatArray = self._call(self._number["inverse"], self._inner.inverse, velocity, state)
        return axes

    def brisk(self) -> Mapping[str, Callable[..., Any]]:
        checked = {method: self._brisk(method, self._layout) for method in ("command", "idle")}
        return {**checked, "inverse": self._brisk("inverse")}


class WatchedDynamics(_Watched, Dynamics):
    """A machine."""

    _stepped: FloatArray | None = None
    """What the last step returned and was checked; as a state it need not be checked again."""

    def state(self) -> FloatArray:
        number = self._number["state"]
        values: FloatArray = self._call(number, self._inner.state)
        return values if values is self._stepped else self._checked(number, values)

    def step(self, command: FloatArray, dt: float) -> FloatArray:
        number = self._number["step"]
        values: FloatArray = self._call(number, self._inner.step, command, dt)
        self._stepped = self._checked(number, values)
        return values

    def reset(self, pose: Sequence[float]) -> None:
        self._stepped = None
        self._call(self._number["reset"], self._inner.reset, pose)

    def brisk(self) -> Mapping[str, Callable[..., Any]]:
        step, state = self._brisk("step", self._layout), self._brisk("state")
        number, checked = self._number["state"], self._checked
        stepped: FloatArray | None = None

        def step_on(command: FloatArray, dt: float) -> FloatArray:
            nonlocal stepped
            stepped = step(command, dt)
            return stepped

        def state_now() -> FloatArray:
            values: FloatArray = state()
            return values if values is stepped else checked(number, values)

        return {"step": step_on, "state": state_now}

    def bodies(self) -> Sequence[Body]:
        bodies: Sequence[Body] = self._call(self._number["bodies"], self._inner.bodies)
        return bodies


class WatchedTask(_Watched, Task):
    """A task. Its values may be NaN: there is not always something to be shown."""

    def factors(self) -> Mapping[str, Sequence[str]]:
        factors: Mapping[str, Sequence[str]]
        factors = self._call(self._number["factors"], self._inner.factors)
        return factors

    def plan(self, levels: Mapping[str, Sequence[str]]) -> Sequence[PlannedTrial]:
        planned: Sequence[PlannedTrial] = self._call(self._number["plan"], self._inner.plan, levels)
        return planned

    def evaluate(self, frame: Frame) -> TrialStatus:
        return self._sound(self._call(self._number["evaluate"], self._inner.evaluate, frame))

    def lift_limits(self) -> None:
        self._call(self._number["lift_limits"], self._inner.lift_limits)

    def brisk(self) -> Mapping[str, Callable[..., Any]]:
        evaluate, sound = self._brisk("evaluate"), self._sound
        last: TrialStatus | None = None

        def judged(frame: Frame) -> TrialStatus:
            nonlocal last
            judgement: TrialStatus = evaluate(frame)
            if judgement is not last:  # while nothing happens, most tasks say the same again
                last = sound(judgement)
            return judgement

        return {"evaluate": judged}

    def _sound(self, judgement: TrialStatus) -> TrialStatus:
        number = self._number["evaluate"]
        if not isinstance(judgement, TrialStatus):
            raise PluginError(self._oversight.complaint(number, f"returned {judgement!r}"))
        self._oversight.check(number, judgement.values, self._layout, finite=False)
        return judgement


class WatchedQuestionnaire(_Watched, Questionnaire):
    """A questionnaire."""

    def items(self) -> Sequence[Item]:
        items: Sequence[Item] = self._call(self._number["items"], self._inner.items)
        return items

    def score(self, answers: Answers) -> Mapping[str, float]:
        scores: Mapping[str, float] = self._call(self._number["score"], self._inner.score, answers)
        return scores


WATCHED: Mapping[type[Component], type[_Watched]] = {
    InputDevice: WatchedInput,
    Controller: WatchedController,
    Dynamics: WatchedDynamics,
    Task: WatchedTask,
    Questionnaire: WatchedQuestionnaire,
}
