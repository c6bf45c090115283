"""Crane whose joints follow speed commands: its signals, its drives and its visual shape."""

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from labcrane.core import compiled
from labcrane.core.cranes import law
from labcrane.core.cranes.actuator import Actuator
from labcrane.core.cranes.crane_settings import CraneSettings
from labcrane.core.cranes.crane_state import CraneState
from labcrane.core.kernel import STATE, Kernel, Places
from labcrane.core.records import Frame, Run, Value
from labcrane.core.roles import Dynamics
from labcrane.core.signals import Signal
from labcrane.errors import PluginError, ProtocolError
from labcrane.machines.links import link_boxes
from labcrane.machines.machine import Body, Machine
from labcrane.types import FloatArray

ROUNDING_S = 1e-9

ENGINE_DEVIATION = 1e-9
"""Tolerance between angles and speeds of a compiled kernel and an engine's, in rad and rad/s: it
rounds differently, by some 1e-14."""


POSE_ROUNDING = 1e-9
"""How far in rad a pose may lie outside the limits: degrees do not convert exactly."""


def crane_signals(machine: Machine) -> tuple[Signal, ...]:
    """Return the signals of a crane's state, in order."""
    return (
        Signal("joint.angle", "rad", machine.names),
        Signal("joint.velocity", "rad/s", machine.names),
        Signal("tip.position", "m", ("x", "y", "z")),
        Signal("tip.velocity", "m/s", ("x", "y", "z")),
    )


def drive_signals(machine: Machine) -> tuple[Signal, ...]:
    """Return the further signals of a crane's state with drives of limited torque.

    ``joint.load`` is the drive's torque as a share of the joint's effort, with its sign;
    ``joint.saturated`` is 1 or -1 at its limit, by its direction, and else 0.
    """
    return (
        Signal("joint.load", "1", machine.names),
        Signal("joint.saturated", "1", machine.names),
    )


class Crane(Dynamics):
    """A crane whose joints follow speed commands through their actuators.

    A subclass moves them: it sets angles (``_place``) and moves joints for one tick at given
    speeds (``_move``). A speed holds over its tick.

    Parameters
    ----------
    settings
        The delays of its drives.
    machine
        Its joints, limits and links.
    """

    has_drives = False
    """Whether its joints have drives of limited torque, whose load its state holds."""

    def __init__(self, settings: CraneSettings, machine: Machine) -> None:
        drives = drive_signals(machine) if self.has_drives else ()
        self.signals = (*crane_signals(machine), *drives)
        self._settings = settings
        self._machine = machine
        self._state = CraneState(machine, drives=self.has_drives)

    def open(self, run: Run) -> None:
        self._drive = run.command.find("command")
        asked, there = self._drive.stop - self._drive.start, len(self._machine.joints)
        if asked != there:
            raise ProtocolError(
                f"{run.command.owner} commands {asked} joints; this machine has {there} "
                f"({', '.join(self._machine.names)})"
            )
        self._dt = 1.0 / run.rate_hz
        self._actuator = Actuator(self._settings.actuator, self._machine.speeds, self._dt)
        self._lowest, self._highest = zip(*self._machine.limits, strict=True)
        self.reset(self._machine.rest)

    def state(self) -> FloatArray:
        return self._state.values

    def step(self, command: FloatArray, dt: float) -> FloatArray:
        if abs(dt - self._dt) > ROUNDING_S:
            raise PluginError(
                f"a step of {dt:g} s was asked for; the crane was opened for ticks of "
                f"{self._dt:g} s and cannot change them while it runs"
            )
        return self._move(self._actuator.follow(command[self._drive].tolist()))

    def reset(self, pose: Sequence[float]) -> None:
        angles = _in_reach(self._machine, pose)
        self._actuator.reset()
        self._place(angles)
        self._state.fill(angles, [0.0] * len(angles))

    def bodies(self) -> Sequence[Body]:
        return link_boxes(self._machine)

    def metadata(self) -> Mapping[str, Value]:
        actuator = self._settings.actuator.model_dump()
        return {f"actuator.{name}": value for name, value in actuator.items()}

    def law_kernel(self) -> Kernel:
        """Return the kernel of a crane that follows the velocity law in every tick.

        Its :meth:`_stand` and :meth:`_motion` set and return its state for the kernel.
        """
        return self._kernel_of(law.step)

    def engine_kernel(self) -> Kernel | None:
        """Return the kernel of a crane in an engine, for ticks in which all drives have the torque.

        All other ticks are the engine's. None for a crane that is not made of beams on the slew
        axis: the kernel does not have its equations.
        """
        slew, *_ = joints = self._machine.joints
        if slew.a or any(joint.inertia_kgm2 or joint.centre_m for joint in joints):
            return None
        return self._kernel_of(law.step_engine, law.links_of(self._machine), ENGINE_DEVIATION)

    def _kernel_of(
        self, step: Callable[..., int], further: Sequence[float] = (), deviation: float = 0.0
    ) -> Kernel:
        """Return the kernel for a ``step``.

        It is given the numbers of the machine and of its actuator, ``further`` ones, then angles,
        speeds, the actuator's speeds and pending commands, which it keeps up to date.
        """
        joints, actuator = self._machine.joints, self._actuator
        head = (
            len(joints), actuator.delay, self._dt, self._machine.base_x, joints[0].d,
            self._drive.start, 10 + 5 * len(joints) + len(further), float(actuator.ideal),
            actuator.share, 0.0,
        )  # fmt: skip
        lengths, offsets = zip(*((joint.a, joint.offset) for joint in joints), strict=True)
        moving = [0.0] * (2 * len(joints) + len(actuator.numbers))
        tables = (*actuator.most, *self._lowest, *self._highest, *lengths, *offsets)
        own = np.array([*head, *tables, *further, *moving])
        return Kernel(
            compiled.tick(step),
            own,
            len(own),
            self._take_over,
            self._hand_back,
            deviation=deviation,
        )

    def _take_over(self, own: FloatArray, seen: Frame) -> bool:
        angles, speeds = self._motion()
        own[int(own[6]) :] = [*angles, *speeds, *self._actuator.numbers]
        return True

    def _hand_back(self, own: FloatArray, rows: FloatArray, places: Places) -> None:
        joints, at = len(self._machine.joints), int(own[6])
        self._actuator.numbers = own[at + 2 * joints :].tolist()
        values = self._state.values
        values[:] = rows[-1, places[STATE] : places[STATE] + len(values)]
        self._stand(values[:joints].tolist(), values[joints : 2 * joints].tolist())

    def _motion(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return the joints' angles in rad and speeds in rad/s, for a kernel."""
        joints, values = len(self._machine.joints), self._state.values.tolist()
        return values[:joints], values[joints : 2 * joints]

    def _stand(self, angles: Sequence[float], speeds: Sequence[float]) -> None:
        """Continue from ``angles`` in rad and ``speeds`` in rad/s, the end of a kernel's ticks."""

    def _turn(self, angles: list[float], speeds: list[float]) -> FloatArray:
        """Turn all joints at their speeds, each within its range; return the filled state."""
        law.turn(angles, speeds, self._lowest, self._highest, self._dt)
        return self._state.fill(angles, speeds)

    @abstractmethod
    def _place(self, angles: Sequence[float]) -> None:
        """Set ``angles`` in rad, at rest, without any history."""

    @abstractmethod
    def _move(self, speeds: Sequence[float]) -> FloatArray:
        """Move for one tick at ``speeds`` in rad/s; return the filled state."""


def _in_reach(machine: Machine, pose: Sequence[float]) -> list[float]:
    """Return ``pose`` in rad as plain floats, or raise :class:`ProtocolError`."""
    angles = [float(angle) for angle in pose]
    if len(angles) != len(machine.joints):
        raise ProtocolError(
            f"a pose of {len(angles)} angles was asked for; this machine has "
            f"{len(machine.joints)} joints ({', '.join(machine.names)})"
        )
    for joint, angle in zip(machine.joints, angles, strict=True):
        lowest, highest = joint.limits
        if not lowest - POSE_ROUNDING <= angle <= highest + POSE_ROUNDING:
            raise ProtocolError(
                f"a pose with {joint.name} at {math.degrees(angle):.2f} degrees was asked for; "
                f"it goes from {joint.range_deg[0]:g} to {joint.range_deg[1]:g}"
            )
    return angles
