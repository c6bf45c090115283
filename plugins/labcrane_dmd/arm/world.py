"""The engine with one arm, the ground, and a scene."""

import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from labcrane import Machine, PluginError
from labcrane.machines import GRAVITY, PlacedObject, points_in_numbers
from labcrane_dmd.arm.contacts import Contacts
from labcrane_dmd.arm.engine import pybullet
from labcrane_dmd.arm.grip import Grip
from labcrane_dmd.arm.scene_bodies import StandingBody, add, add_ground, check_apart
from labcrane_dmd.arm.settings import ArmSettings
from labcrane_dmd.arm.urdf import urdf_of

ITERATIONS = 400
"""Solver passes per tick; with the engine's 50, joints creep under their own weight."""

JOINTED_ITERATIONS = 150
"""Solver passes with an articulated casualty, who has many more contacts: with 400 passes, a tick
would take three times as long. The arm creeps by 5e-12 degrees per second; with 50 passes, by
4e-4."""

LIMIT_FORCE = 1e7
"""In N m. The engine's own is weaker than a drive (bullet3 #2944)."""


class World:
    """Step the engine; reopened for every trial, so that the same commands give the same bits.

    Parameters
    ----------
    settings, machine
        The arm.
    dt
        Length of a tick, in seconds.
    angles
        Joint angles in rad at the start.
    placed
        The scene's things.
    """

    def __init__(
        self,
        settings: ArmSettings,
        machine: Machine,
        dt: float,
        angles: Sequence[float],
        placed: Sequence[PlacedObject],
    ) -> None:
        jointed = any(each.jointed for each in placed)
        client = _engine(dt, JOINTED_ITERATIONS if jointed else ITERATIONS)
        self._client: int | None = client
        self.arm = _load(machine, settings, client)
        self._jaws = settings.jaws is not None
        joints = len(machine.joints) + (1 if self._jaws else 0)
        self._efforts = tuple(joint.effort for joint in machine.joints)
        efforts = [*self._efforts, self._efforts[-1]] if self._jaws else list(self._efforts)
        for joint, angle in enumerate(self._split(angles)):
            _prepare(self.arm, joint, client)
            pybullet.resetJointState(self.arm, joint, angle, 0.0, physicsClientId=client)
        self._push = partial(
            pybullet.setJointMotorControlArray,
            self.arm,
            range(joints),
            pybullet.VELOCITY_CONTROL,
            forces=efforts,
            physicsClientId=client,
        )
        self._read = partial(
            pybullet.getJointStates, self.arm, range(joints), physicsClientId=client
        )
        self._furnish(settings, placed, client, dt, joints)

    def _furnish(
        self,
        settings: ArmSettings,
        placed: Sequence[PlacedObject],
        client: int,
        dt: float,
        joints: int,
    ) -> None:
        ticks = max(1, round(settings.window_s / dt))
        self.things = [add(each, client) for each in placed]
        self.contacts: Contacts | None = None
        self.grip: Grip | None = None
        if not self.things:
            return
        try:
            check_apart(self.things, self.arm, client)
        except BaseException:
            self.close()
            raise
        ground = add_ground(client)
        # The column is on the ground; a contact there would only resist the slewing.
        pybullet.setCollisionFilterPair(self.arm, ground, 0, -1, 0, physicsClientId=client)
        self.contacts = Contacts(self.things, self.arm, ground, client, ticks)
        if settings.jaws is not None:
            release = settings.jaws.release_deg * DEGREE
            jaws = (joints - 2, joints - 1)
            self._most = self._efforts[-1] / settings.jaws.length_m
            # Each jaw turns by half the opening.
            self._tightening = 0.5 * dt * settings.jaws.length_m * 1000.0 * settings.jaws.squeeze_n
            self.grip = Grip(self.arm, jaws, client, settings.jaws.grip_n, release, ticks)

    def step(self, speeds: Sequence[float]) -> tuple[list[float], list[float], list[float]]:
        """Move for a tick at ``speeds`` in rad/s.

        Returns
        -------
        tuple
            Angles in rad, speeds in rad/s, and loads as fractions of the joints' efforts.
        """
        held = self.grip is not None and self.grip.held is not None
        if held and speeds[-1] < 0.0:  # jaws that hold something cannot close further
            if self.grip is not None:
                self.grip.tighten(-speeds[-1] * self._tightening)
            speeds = [*speeds[:-1], 0.0]
        self._push(targetVelocities=self._split(speeds))
        pybullet.stepSimulation(physicsClientId=self._client)
        states = self._read()
        angles = self._joined([state[0] for state in states])
        moved = self._joined([state[1] for state in states])
        torques = [state[3] for state in states[: len(self._efforts)]]
        loads = [torque / most for torque, most in zip(torques, self._efforts, strict=True)]
        if self.contacts is not None:
            self.contacts.look({} if self.grip is None else self.grip.squeezed(self._most))
            if self.grip is not None:
                self.grip.look(self.contacts, self.things, angles[-1])
        return angles, moved, loads

    def where(self, body: int) -> tuple[Sequence[float], Sequence[float]]:
        """Return a body's position in m and its orientation as a quaternion x, y, z, w."""
        found: tuple[Sequence[float], Sequence[float]] = pybullet.getBasePositionAndOrientation(
            body, physicsClientId=self._client
        )
        return found

    def segment(self, standing: StandingBody, name: str) -> tuple[Sequence[float], Sequence[float]]:
        """Return where a jointed thing's segment is, and its orientation; as :meth:`where`."""
        link, centre = standing.segments[name]
        state = pybullet.getLinkState(standing.body, link, physicsClientId=self._client)
        found: tuple[Sequence[float], Sequence[float]] = pybullet.multiplyTransforms(
            *state[FRAME:ORIENTED], centre, (0.0, 0.0, 0.0, 1.0)
        )
        return found

    def close(self) -> None:
        """Stop the engine."""
        if self._client is not None:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = None

    def _split(self, values: Sequence[float]) -> list[float]:
        if not self._jaws:
            return list(values)
        return [*values[:-1], 0.5 * values[-1], 0.5 * values[-1]]

    def _joined(self, values: Sequence[float]) -> list[float]:
        if not self._jaws:
            return list(values)
        return [*values[:-2], values[-2] + values[-1]]


FRAME, ORIENTED = 4, 6
"""Places of a link's frame in the engine's link state: its position, and behind its orientation."""

DEGREE = 0.017453292519943295


def _engine(dt: float, iterations: int) -> int:
    """Start an engine that steps by ``dt`` in s; return its number."""
    client: int | None = pybullet.connect(pybullet.DIRECT)
    if client is None or client < 0:
        raise PluginError(
            "PyBullet could not start another engine; close other programs that use it"
        )
    pybullet.setPhysicsEngineParameter(
        fixedTimeStep=dt,
        numSubSteps=0,
        numSolverIterations=iterations,
        solverResidualThreshold=0.0,
        deterministicOverlappingPairs=1,
        physicsClientId=client,
    )
    pybullet.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=client)
    return client


def _load(machine: Machine, settings: ArmSettings, client: int) -> int:
    with tempfile.TemporaryDirectory(prefix="labcrane-") as folder, points_in_numbers():
        path = Path(folder) / "arm.urdf"
        path.write_text(urdf_of(machine, settings.jaws), encoding="utf-8")
        arm: int = pybullet.loadURDF(
            str(path),
            useFixedBase=True,
            flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
            physicsClientId=client,
        )
    return arm


def _prepare(body: int, joint: int, client: int) -> None:
    # The limit's force goes alone: settings in one call can displace each other (bullet3 #4133).
    pybullet.changeDynamics(
        body,
        joint,
        linearDamping=0.0,
        angularDamping=0.0,
        jointDamping=0.0,
        lateralFriction=0.8,
        physicsClientId=client,
    )
    pybullet.changeDynamics(body, joint, jointLimitForce=LIMIT_FORCE, physicsClientId=client)
