"""Load that hangs from a crane's tip, and cranes that bear one, in whatever engine."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from labcrane.core.cranes.crane import Crane
from labcrane.core.cranes.crane_settings import GrappleSettings, LoadedCraneSettings
from labcrane.core.records import Value
from labcrane.core.signals import Signal
from labcrane.machines.machine import Body, Machine
from labcrane.machines.urdf import urdf_link, urdf_of
from labcrane.types import FloatArray

SWIVEL_KG = 0.01
"""Of the link between both hinges: engines need some mass, and this sways nothing."""

SWIVEL_M = 0.1
WAYS = ("along", "across")
STILL = (0.0, 0.0)


class HangingLoad:
    """A payload, or a grapple on two hinges that nothing drives, and a state that has it.

    Swings count from hanging straight down: ``along`` outward, ``across`` to the left.

    Parameters
    ----------
    machine
        What it hangs on.
    settings
        What hangs.
    bare
        The signals of the crane without it, which come first.

    Attributes
    ----------
    signals
        What the state holds, in order.
    values
        The state, shape ``(n_state,)``, filled again on every tick.
    """

    def __init__(
        self, machine: Machine, settings: LoadedCraneSettings, bare: Sequence[Signal]
    ) -> None:
        self._machine = machine
        self._settings = settings
        self._grapple = settings.grapple
        self.signals: tuple[Signal, ...] = tuple(bare)
        if self._grapple:
            self.signals += (
                Signal("grapple.swing", "rad", WAYS),
                Signal("grapple.swing_rate", "rad/s", WAYS),
                Signal("grapple.position", "m", ("x", "y", "z")),
                Signal("grapple.orientation", "1", ("x", "y", "z", "w")),
            )
        self.values: FloatArray = np.zeros(sum(len(signal.columns) for signal in self.signals))

    def urdf(self) -> tuple[str, ...]:
        """Return its links and joints behind the crane's last link, for ``urdf_of``.

        A grapple's first hinge is about the pitch axis, and its second across it.
        """
        last = self._machine.joints[-1]
        tip = f'<origin xyz="{last.a!r} 0 0"/>'
        mass, grapple = self._settings.hanging_kg, self._grapple
        if grapple is None:
            return (
                urdf_link("payload", mass, (last.thickness,) * 3),
                f'<joint name="payload" type="fixed"><parent link="{last.name}"/>'
                f'<child link="payload"/>{tip}</joint>',
            )
        return (
            urdf_link("swivel", SWIVEL_KG, (SWIVEL_M,) * 3),
            _hinge("swivel", last.name, tip, "0 1 0"),
            urdf_link("grapple", mass, (grapple.size_m,) * 3, (0.0, 0.0, -grapple.length_m)),
            _hinge("grapple", "swivel", "", "1 0 0"),
        )

    def bodies(self) -> tuple[Body, ...]:
        """Return what is drawn of it."""
        if self._grapple is None:
            return ()
        edge, long = self._grapple.size_m, self._grapple.length_m
        rod = (0.12 * edge, 0.12 * edge, long)
        return (
            Body("grapple", 0, (edge, edge, edge), (0.0, 0.0, 0.0), moves="grapple"),
            Body("grapple rod", 0, rod, (0.0, 0.0, 0.5 * long), moves="grapple"),
        )

    def pitch(self, angles: Sequence[float]) -> float:
        """Return how far the last link points down with joints at ``angles``, all in rad."""
        chain = zip(angles[1:], self._machine.joints[1:], strict=True)
        return sum(angle + joint.offset for angle, joint in chain)

    def fill(
        self,
        crane: FloatArray,
        hinges: Sequence[float] | None = None,
        rates: Sequence[float] = STILL,
    ) -> FloatArray:
        """Return the state.

        Parameters
        ----------
        crane
            The state without the load, shape ``(n_crane,)``.
        hinges
            Angles of the grapple's hinges, in rad; by default those at which it hangs still.
        rates
            Their speeds, in rad/s.
        """
        values = crane.tolist()
        joints = len(self._machine.joints)
        angles, speeds = values[:joints], values[joints : 2 * joints]
        tip = values[2 * joints : 2 * joints + 3]
        if self._grapple:
            swing, rate = STILL, STILL
            if hinges is not None:
                swing = (-(hinges[0] + self.pitch(angles)), hinges[1])
                rate = (-(rates[0] + sum(speeds[1:])), rates[1])
            bearing = angles[0] + self._machine.joints[0].offset
            values += [*swing, *rate, *_place(self._grapple, tip, bearing, *swing)]
        self.values[:] = values
        return self.values


class LoadedCrane(Crane):
    """A crane's state with what hangs from its tip, and where the grapple is.

    An engine's crane becomes one with a load by this class before its own:
    ``class LoadedBulletCrane(LoadedCrane, BulletCrane)``. It fills the state by ``self._load``.
    """

    def __init__(self, settings: LoadedCraneSettings, machine: Machine) -> None:
        super().__init__(settings, machine)
        self._loaded = settings
        self._load = HangingLoad(machine, settings, self.signals)
        self.signals = self._load.signals

    def kernel(self) -> None:
        return None  # what hangs on it moves by the engine's law

    def state(self) -> FloatArray:
        return self._load.values

    def reset(self, pose: Sequence[float]) -> None:
        super().reset(pose)
        self._load.fill(self._state.values)

    def bodies(self) -> Sequence[Body]:
        return (*super().bodies(), *self._load.bodies())

    def metadata(self) -> Mapping[str, Value]:
        return {**super().metadata(), "hanging.mass_kg": self._loaded.hanging_kg}

    def _urdf(self) -> str:
        return urdf_of(self._machine, beyond=self._load.urdf())


def _place(
    grapple: GrappleSettings, tip: Sequence[float], bearing: float, along: float, across: float
) -> tuple[float, ...]:
    """Return the grapple's centre in m, and its orientation as a quaternion x, y, z, w.

    ``along`` is its swing outward, ``across`` to the left, in rad.
    """
    out = grapple.length_m * math.sin(along) * math.cos(across)
    left = grapple.length_m * math.sin(across)
    down = grapple.length_m * math.cos(along) * math.cos(across)
    ahead, aside = math.cos(bearing), math.sin(bearing)
    x, y, z = tip
    position = (x + out * ahead - left * aside, y + out * aside + left * ahead, z - down)
    (sz, cz), (sy, cy), (sx, cx) = (
        (math.sin(0.5 * angle), math.cos(0.5 * angle)) for angle in (bearing, -along, across)
    )
    return (
        *position,
        sx * cy * cz - cx * sy * sz,
        cx * sy * cz + sx * cy * sz,
        cx * cy * sz - sx * sy * cz,
        cx * cy * cz + sx * sy * sz,
    )


def _hinge(name: str, parent: str, origin: str, axis: str) -> str:
    return (
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{name}"/>'
        f'{origin}<axis xyz="{axis}"/></joint>'
    )
