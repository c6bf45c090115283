"""Contracts of the roles in the loop, and stand-ins for what a component needs beside it."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager

import numpy as np

from labcrane.core.clock import Tick
from labcrane.core.records import Frame, Phase, PlannedTrial, Run, Trial
from labcrane.core.roles import Component, Controller, Dynamics, InputDevice
from labcrane.core.signals import Layout, Signal
from labcrane.machines.kinematics import Arm
from labcrane.machines.library import load_machine
from labcrane.machines.machine import Machine
from labcrane.testing.components import check_closes_after_failed_open, check_soon
from labcrane.types import FloatArray

RATE_HZ = 240.0
"""Ticks a second of a run made by :func:`make_run`."""


def ch8() -> Machine:
    """Return the machine of the crane study."""
    return load_machine("ch8")


def crane_state(machine: Machine) -> Layout:
    """Return the state that every bundled crane has."""
    return Layout(
        "the machine",
        (
            Signal("joint.angle", "rad", machine.names),
            Signal("joint.velocity", "rad/s", machine.names),
            Signal("tip.position", "m", ("x", "y", "z")),
            Signal("tip.velocity", "m/s", ("x", "y", "z")),
        ),
    )


def crane_at(machine: Machine, angles: Sequence[float]) -> FloatArray:
    """Return a crane's state at rest at ``angles`` in rad, shape ``(14,)`` for four joints."""
    still = [0.0] * len(angles)
    return np.array([*angles, *still, *Arm(machine).tip(angles), 0.0, 0.0, 0.0])


STICKS = (
    Signal("left", "1", ("x", "y", "trigger")),
    Signal("right", "1", ("x", "y", "trigger")),
)
"""The axes of a dual joystick, as far as tests need them."""


def make_run(
    machine: Machine,
    *,
    axes: Sequence[Signal] = STICKS,
    command: Sequence[Signal] | None = None,
    state: Sequence[Signal] | None = None,
    task: Sequence[Signal] = (),
    inverse: Callable[[FloatArray, FloatArray], FloatArray] | None = None,
) -> Run:
    """Return a run beside which one component can be opened."""
    drive = (Signal("command", "rad/s", machine.names),)
    layout = Layout("the input", tuple(axes))
    return Run(
        rate_hz=RATE_HZ,
        machine=machine,
        participant_seed=1,
        axes=layout,
        command=Layout("the scheme", tuple(command or drive)),
        state=Layout("the machine", tuple(state)) if state else crane_state(machine),
        task=Layout("the task", tuple(task)),
        inverse=inverse or (lambda velocity, state: np.zeros(layout.size)),
    )


def make_frame(run: Run, number: int = 0, state: FloatArray | None = None) -> Frame:
    """Return a frame in which nothing has happened yet."""
    due = number / run.rate_hz
    return Frame(
        tick=Tick(number, due, due),
        elapsed=due,
        axes=np.zeros(run.axes.size),
        command=np.zeros(run.command.size),
        state=crane_at(run.machine, run.machine.rest) if state is None else state,
        task=np.full(run.task.size, np.nan),
        phase=Phase.RUNNING,
        trial=1,
    )


def make_trial(planned: PlannedTrial | None = None, seed: int = 1) -> Trial:
    """Return a first attempt."""
    return Trial(1, 1, seed, planned or PlannedTrial({}, expected_s=1.0))


@contextmanager
def opened(component: Component, run: Run) -> Iterator[None]:
    """Open ``component`` and close it again, as a session does."""
    with closing(component):
        component.open(run)
        yield


def check_array(component: Component, array: FloatArray) -> None:
    """Check that a tick method returned what the component's signals promise.

    Parameters
    ----------
    component
        Whose ``signals`` say how many numbers there are.
    array
        What it returned: shape ``(n_signals,)``, in the signals' units.
    """
    name = type(component).__name__
    size = Layout(name, component.signals).size
    assert array.shape == (size,), f"{name}.signals promise shape ({size},), got {array.shape}"
    assert array.dtype == np.float64, f"{name} must return float64, got {array.dtype}"
    assert np.isfinite(array).all(), f"{name} returned {array}"


def check_signals(component: Component) -> None:
    """Check that signal names are dotted lower-case words, and that no column occurs twice."""
    name = type(component).__name__
    columns = Layout(name, component.signals).columns
    twice = sorted({column for column in columns if columns.count(column) > 1})
    assert not twice, (
        f"{name}.signals have a column more than once: {', '.join(twice)}; give each Signal a name "
        "of its own"
    )
    for column in columns:
        assert all(word.isidentifier() and word.islower() for word in column.split(".")), (
            f"{name}.signals have a column {column!r}; write words of small letters, digits and _ "
            "with dots between them, such as 'tip.position.x'"
        )


class InputContract:
    """What every input device must do. Provide the fixture ``device``.

    Set ``goes_on`` for a device that does not restart with a trial: a log that is played.
    """

    goes_on = False

    def test_device_reads_what_its_signals_promise(self, device: InputDevice) -> None:
        check_signals(device)
        run = make_run(ch8(), axes=device.signals)
        with opened(device, run):
            device.begin_trial(make_trial())
            for number in range(10):
                frame = make_frame(run, number)
                axes = device.read(frame.tick, frame)
                check_array(device, axes)
                assert np.abs(axes).max(initial=0.0) <= 1.0, f"an axis is outside [-1, 1]: {axes}"

    def test_a_trials_seed_decides_all_that_is_random(self, device: InputDevice) -> None:
        run = make_run(ch8(), axes=device.signals)
        with opened(device, run):
            read = []
            for _ in range(2):
                device.begin_trial(make_trial(seed=7))
                frames = [make_frame(run, number) for number in range(20)]
                read.append([device.read(frame.tick, frame).copy() for frame in frames])
            if not self.goes_on:
                np.testing.assert_array_equal(read[0], read[1])

    def test_device_reads_at_once(self, device: InputDevice) -> None:
        run = make_run(ch8(), axes=device.signals)
        frame = make_frame(run)
        with opened(device, run):
            device.begin_trial(make_trial())
            check_soon(lambda: device.read(frame.tick, frame))

    def test_device_closes_without_having_been_opened(self, device: InputDevice) -> None:
        device.close()

    def test_device_closes_after_a_failed_open(self, device: InputDevice) -> None:
        check_closes_after_failed_open(device)


class ControllerContract:
    """What every controller must do. Provide the fixture ``controller``."""

    def test_controller_commands_what_its_signals_promise(self, controller: Controller) -> None:
        check_signals(controller)
        machine = ch8()
        run = make_run(machine, command=controller.signals)
        with opened(controller, run):
            controller.begin_trial(make_trial())
            state = crane_at(machine, machine.rest)
            for push in (-1.0, 0.0, 0.3, 1.0):
                command = controller.command(np.full(run.axes.size, push), state)
                check_array(controller, command)
            check_array(controller, controller.idle())

    def test_the_same_axes_give_the_same_command_in_every_trial(
        self, controller: Controller
    ) -> None:
        machine = ch8()
        run = make_run(machine, command=controller.signals)
        state = crane_at(machine, machine.rest)
        with opened(controller, run):
            given = []
            for _ in range(2):
                controller.begin_trial(make_trial(seed=7))
                commands = [controller.command(_push(run, x), state) for x in (0.2, -0.7, 1.0)]
                given.append([command.copy() for command in commands])
            np.testing.assert_array_equal(given[0], given[1])

    def test_controller_commands_at_once(self, controller: Controller) -> None:
        machine = ch8()
        run = make_run(machine, command=controller.signals)
        state = crane_at(machine, machine.rest)
        with opened(controller, run):
            check_soon(lambda: controller.command(_push(run, 0.5), state))

    def test_controller_closes_after_a_failed_open(self, controller: Controller) -> None:
        check_closes_after_failed_open(controller)

    def test_hands_at_rest_ask_for_no_motion(self, controller: Controller) -> None:
        machine = ch8()
        run = make_run(machine, command=controller.signals)
        drive = run.command.find("command")
        with opened(controller, run):
            state = crane_at(machine, machine.rest)
            command = controller.command(np.zeros(run.axes.size), state)
            assert not command[drive].any(), f"axes at 0 must ask for no motion, not {command}"
            idle = controller.idle()
            assert not idle[drive].any(), f"idle() must ask for no motion, not {idle}"

    def test_no_command_exceeds_the_joint_speeds(self, controller: Controller) -> None:
        machine = ch8()
        run = make_run(machine, command=controller.signals)
        drive = run.command.find("command")
        random = np.random.default_rng(1)
        lowest, highest = np.array(machine.limits).T
        with opened(controller, run):
            for _ in range(200):
                state = crane_at(machine, random.uniform(lowest, highest).tolist())
                axes = random.uniform(-1, 1, run.axes.size)
                command = controller.command(axes, state)[drive]
                fine = np.abs(command) <= np.array(machine.speeds) * (1 + 1e-12)
                assert fine.all(), f"{command} rad/s is beyond the joints' {machine.speeds} rad/s"

    def test_steering_stays_within_the_axes(self, controller: Controller) -> None:
        machine = ch8()
        run = make_run(machine, command=controller.signals)
        with opened(controller, run):
            state = crane_at(machine, machine.rest)
            for velocity in np.vstack([np.eye(3), -5.0 * np.eye(3)]):
                axes = controller.inverse(velocity, state)
                assert axes.shape == (run.axes.size,), f"inverse() gave shape {axes.shape}"
                assert np.abs(axes).max() <= 1.0, f"inverse() must stay within -1 to 1: {axes}"


def _push(run: Run, push: float) -> FloatArray:
    return np.full(run.axes.size, push)


class DynamicsContract:
    """What every machine must do. Provide the fixture ``dynamics``."""

    def test_dynamics_returns_what_its_signals_promise(self, dynamics: Dynamics) -> None:
        check_signals(dynamics)
        machine = ch8()
        run = make_run(machine, state=dynamics.signals)
        with opened(dynamics, run):
            check_array(dynamics, dynamics.state())
            check_array(dynamics, dynamics.step(0.5 * np.array(machine.speeds), 1 / RATE_HZ))
            assert dynamics.bodies(), "bodies() must return what is drawn of the machine"

    def test_reset_forgets_everything(self, dynamics: Dynamics) -> None:
        machine = ch8()
        run = make_run(machine, state=dynamics.signals)
        with opened(dynamics, run):
            paths = []
            for _ in range(2):
                dynamics.reset(machine.rest)
                push = 0.5 * np.array(machine.speeds)
                paths.append(np.array([dynamics.step(push, 1 / RATE_HZ).copy() for _ in range(50)]))
            np.testing.assert_array_equal(paths[0], paths[1])

    def test_dynamics_steps_at_once(self, dynamics: Dynamics) -> None:
        machine = ch8()
        run = make_run(machine, state=dynamics.signals)
        with opened(dynamics, run):
            dynamics.begin_trial(make_trial())
            check_soon(lambda: dynamics.step(np.zeros(run.command.size), 1 / RATE_HZ))

    def test_dynamics_closes_after_a_failed_open(self, dynamics: Dynamics) -> None:
        check_closes_after_failed_open(dynamics)

    def test_a_machine_at_rest_stays(self, dynamics: Dynamics) -> None:
        machine = ch8()
        run = make_run(machine, state=dynamics.signals)
        angle = run.state.find("joint.angle")
        with opened(dynamics, run):
            before = dynamics.state()[angle].copy()
            for _ in range(int(RATE_HZ)):
                dynamics.step(np.zeros(run.command.size), 1 / RATE_HZ)
            np.testing.assert_allclose(dynamics.state()[angle], before, atol=np.radians(0.001))
