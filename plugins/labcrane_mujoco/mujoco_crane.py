"""A crane moved by MuJoCo, with the torques that give the speeds asked for."""

from collections.abc import Mapping, Sequence
from functools import partial
from importlib.metadata import version
from struct import Struct

import mujoco
import numpy as np

from labcrane import FloatArray, Machine, Run
from labcrane.core import Crane, CraneSettings, Kernel, Value
from labcrane.machines import GRAVITY, urdf_of
from labcrane_mujoco.limited_drives import limited_torques


class MujocoCrane(Crane):
    """Drives that give each joint its speed at the end of the tick, up to its effort.

    The engine's mass matrix and bias forces say which torques that takes. Where a drive has not the
    torque, those of all joints are solved for together, so that only its own joint and what hangs
    on it are slower. The engine's own velocity servos cannot hold a crane at 240 Hz.

    No joint is asked to go beyond its limit. One that its drive cannot stop in time is stopped by
    an end stop of ours: the engine's own limits are soft, and let a joint through by 0.3 degrees.
    """

    has_drives = True

    def __init__(self, settings: CraneSettings, machine: Machine) -> None:
        super().__init__(settings, machine)
        self._joints = len(machine.joints)
        self._limits = machine.limits
        self._efforts = tuple(joint.effort for joint in machine.joints)

    def open(self, run: Run) -> None:
        self._model = model = mujoco.MjModel.from_xml_string(self._urdf())
        model.opt.timestep = 1.0 / run.rate_hz
        model.opt.gravity[:] = (0.0, 0.0, -GRAVITY)
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
        # A failed computation must reach the loop; the engine must not reset with a warning.
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT  # nothing here has a shape
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
        self._mass: FloatArray = np.zeros((model.nv, model.nv))
        self._data = data = mujoco.MjData(model)
        # Views: asking the engine's structure for them costs more than using them.
        self._positions, self._velocities = data.qpos, data.qvel
        self._wanted: FloatArray = np.zeros(model.nv)
        self._inertial: FloatArray = np.zeros(model.nv)
        self._needed: FloatArray = np.zeros(model.nv)
        self._prepare = partial(mujoco.mj_step1, model, data)
        self._integrate = partial(mujoco.mj_step2, model, data)
        self._multiply = partial(mujoco.mj_mulM, model, data, self._inertial, self._wanted)
        self._add = partial(np.add, self._inertial, data.qfrc_bias, self._needed)
        # Packing numbers into an array costs half of assigning them.
        pack = Struct(f"{self._joints}d").pack_into
        self._want = partial(pack, self._wanted.data, 0)
        self._apply = partial(pack, data.qfrc_applied.data, 0)
        super().open(run)

    def metadata(self) -> Mapping[str, Value]:
        return {**super().metadata(), "engine": f"mujoco {version('mujoco')}"}

    def kernel(self) -> Kernel | None:
        return self.engine_kernel()

    def _motion(self) -> tuple[Sequence[float], Sequence[float]]:
        return self._angles, self._speeds

    def _stand(self, angles: Sequence[float], speeds: Sequence[float]) -> None:
        self._positions[:], self._velocities[:] = angles, speeds
        self._begin()

    def _urdf(self) -> str:
        return urdf_of(self._machine)

    def _place(self, angles: Sequence[float]) -> None:
        mujoco.mj_resetData(self._model, self._data)
        self._positions[: self._joints] = angles
        self._begin()

    def _begin(self) -> None:
        """Work out what the next tick's torques depend on."""
        self._prepare()
        self._angles: list[float] = self._positions.tolist()
        self._speeds: list[float] = self._velocities.tolist()

    def _move(self, speeds: Sequence[float]) -> FloatArray:
        return self._state.fill(*self._push(speeds))

    def _push(
        self, speeds: Sequence[float]
    ) -> tuple[list[float], list[float], list[float], list[float] | None]:
        """Make a tick at ``speeds`` in rad/s.

        Returns
        -------
        tuple
            Angles in rad and speeds in rad/s of the joints, their drives' torques as shares of the
            efforts, and where they give all they have; None for nowhere.
        """
        dt = self._dt
        accelerations = [
            (speed - was) / dt
            if lowest <= angle + speed * dt <= highest
            else (((lowest if angle + speed * dt < lowest else highest) - angle) / dt - was) / dt
            for speed, was, angle, (lowest, highest) in zip(
                speeds, self._speeds, self._angles, self._limits, strict=False
            )
        ]
        self._want(*accelerations)
        self._multiply()
        self._add()
        torques = self._torques()
        loads = [torque / effort for torque, effort in zip(torques, self._efforts, strict=False)]
        saturated = None
        if max(loads) <= 1.0 and min(loads) >= -1.0:
            self._apply(*torques[: self._joints])
        else:
            loads = self._limited(accelerations)
            saturated = [float(load == 1.0) - float(load == -1.0) for load in loads]
        self._integrate()
        self._begin()
        joints = self._joints
        return self._angles[:joints], self._speeds[:joints], loads, saturated

    def _limited(self, accelerations: Sequence[float]) -> list[float]:
        """Apply what limited drives and the end stops push with; return the drives' loads."""
        model, data = self._model, self._data
        mujoco.mj_fullM(model, data, self._mass)
        # The engine's Euler step takes damping implicitly.
        np.einsum("ii->i", self._mass)[:] += self._dt * model.dof_damping
        drives, stops = limited_torques(
            self._mass,
            data.qfrc_passive - data.qfrc_bias,
            self._angles,
            self._speeds,
            [was + self._dt * by for was, by in zip(self._speeds, accelerations, strict=False)],
            self._efforts,
            self._limits,
            self._dt,
        )
        self._apply(*(drives + stops))
        loads: list[float] = (drives / self._efforts).tolist()
        return loads

    def _torques(self) -> list[float]:
        """Return in N m what gives the joints the accelerations wanted."""
        torques: list[float] = self._needed.tolist()
        return torques
