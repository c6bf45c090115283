"""Rig: the components that a study names, built and opened together."""

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from labcrane.core.records import Run, Value
from labcrane.core.roles import Component, Controller, Dynamics, InputDevice, Task
from labcrane.core.signals import Layout, Signal
from labcrane.errors import ProtocolError
from labcrane.protocol.assisted import Assisted, FourHands
from labcrane.protocol.estimated import WithEstimates
from labcrane.protocol.study import Study


@dataclass(frozen=True, slots=True)
class Rig:
    """The components of one run.

    Attributes
    ----------
    tasks
        By the protocol's names for them. Only one of them judges at a time.
    """

    input: InputDevice
    controller: Controller
    dynamics: Dynamics
    tasks: Mapping[str, Task]

    @property
    def components(self) -> tuple[Component, ...]:
        """Components that begin every trial, the operator's controls last; the task comes after."""
        return (self.dynamics, self.controller, self.input)

    def metadata(self) -> dict[str, Value]:
        """Return the values that the open components record, by dotted name."""
        parts = {"input": self.input, "scheme": self.controller, "dynamics": self.dynamics}
        return {
            f"{part}.{name}": value
            for part, component in parts.items()
            for name, value in component.metadata().items()
        }

    @classmethod
    def build(cls, study: Study, *, simulated: bool, source: str = "") -> "Rig":
        """Build, but do not open, what ``study`` names; a simulated operator replaces the input.

        Estimates are received from the processes of the session ``source``; without one they fall
        back.
        """
        machine = study.machine
        device = (study.operator if simulated else study.input).build(machine)
        controller = build_controller(study)
        dynamics = study.dynamics.build(machine)
        # The registry filed each offer under its role.
        assert isinstance(device, InputDevice)  # noqa: S101
        assert isinstance(dynamics, Dynamics)  # noqa: S101
        if study.estimates:
            device = WithEstimates(device, study.estimates, source)
        if isinstance(controller, Assisted):
            assistant = study.choices["assist"].build(machine)
            assert isinstance(assistant, InputDevice)  # noqa: S101
            device = FourHands(device, assistant, controller.inverse_of_assistant)
        return cls(device, controller, dynamics, study.tasks)

    def describe(self, study: Study, participant_seed: int) -> Run:
        """Return the run of the rig, which need not be open: signals are known before."""
        return Run(
            rate_hz=study.protocol.rate_hz,
            machine=study.machine,
            participant_seed=participant_seed,
            axes=Layout("the input", self.input.signals),
            command=Layout("the scheme", self.controller.signals),
            state=Layout("the machine", self.dynamics.signals),
            task=Layout("the tasks", _task_signals(self.tasks)),
            inverse=self.controller.inverse,
            bodies=tuple(self.dynamics.bodies()),
            places=tuple(place for task in self.tasks.values() for place in task.places()),
        )

    @contextmanager
    def opened(self, study: Study, participant_seed: int) -> Iterator[Run]:
        """Open every component, hardware last, and close them all however that ends."""
        run = self.describe(study, participant_seed)
        with ExitStack() as closing:
            for component in (self.dynamics, *self.tasks.values(), self.controller, self.input):
                closing.callback(component.close)
                component.open(run)
            yield run


def build_controller(study: Study) -> Controller:
    """Build the scheme of a study; with an assistant, one that blends two commands."""
    scheme, assist = study.scheme.build(study.machine), study.protocol.assist
    assert isinstance(scheme, Controller)  # noqa: S101 - the registry filed it under its role
    if assist is None:
        return scheme
    second = study.scheme.build(study.machine)
    assert isinstance(second, Controller)  # noqa: S101
    return Assisted(scheme, second, assist)


def _task_signals(tasks: Mapping[str, Task]) -> tuple[Signal, ...]:
    """Return the signals of the tasks; tasks of one study show the same ones."""
    shown = {task.signals: name for name, task in tasks.items()}
    if len(shown) > 1:
        differ = "; ".join(
            f"{name!r} shows {', '.join(signal.name for signal in signals) or 'nothing'}"
            for signals, name in shown.items()
        )
        raise ProtocolError(
            f"the tasks of one study must show the same signals, and these differ: {differ}; put "
            "them into studies of their own"
        )
    (signals,) = shown
    return signals
