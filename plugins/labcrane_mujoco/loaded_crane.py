"""A crane with something on its tip: a payload, or a grapple that swings."""

from collections.abc import Sequence

import mujoco
import numpy as np

from labcrane import FloatArray, Run
from labcrane.core import LoadedCrane
from labcrane_mujoco.mujoco_crane import MujocoCrane


class LoadedMujocoCrane(LoadedCrane, MujocoCrane):
    """The engine's crane with a hanging load at its tip."""

    def _move(self, speeds: Sequence[float]) -> FloatArray:
        joints = self._joints
        crane = self._state.fill(*self._push(speeds))
        return self._load.fill(crane, self._angles[joints:] or None, self._speeds[joints:])


class GrappleCrane(LoadedMujocoCrane):
    """Drives that also bear the forces of a swinging grapple on the joints."""

    def open(self, run: Run) -> None:
        self._unit: FloatArray = np.zeros((2, len(self._machine.joints) + 2))
        self._unit[:, -2:] = np.eye(2)
        self._columns: FloatArray = np.zeros_like(self._unit)
        super().open(run)

    def _place(self, angles: Sequence[float]) -> None:
        assert self._loaded.grapple is not None  # noqa: S101 - this crane is built for one
        self._model.dof_damping[self._joints :] = self._loaded.grapple.damping
        super()._place(angles)
        self._positions[self._joints] = -self._load.pitch(angles)
        self._begin()

    def _torques(self) -> list[float]:
        """Solve for what the hinges, which nothing drives, do meanwhile.

        With M the mass matrix, b the bias and p the passive forces, split into joints j and hinges
        f: M_ff a_f = p_f - b_f - M_fj a_j, and then the torques are M_jj a_j + M_jf a_f + b_j. The
        engine's Euler step takes damping implicitly, which adds dt times damping to M_ff.
        """
        joints, model, data = self._joints, self._model, self._data
        for unit, column in zip(self._unit, self._columns, strict=True):
            mujoco.mj_mulM(model, data, column, unit)
        needed = self._needed.tolist()
        passive = data.qfrc_passive.tolist()
        first, second = self._columns.tolist()
        stiff = self._dt * float(model.dof_damping[joints])
        a, b, d = first[joints] + stiff, first[joints + 1], second[joints + 1] + stiff
        one, two = (passive[hinge] - needed[hinge] for hinge in (joints, joints + 1))
        whole = a * d - b * b
        swivel, across = (one * d - two * b) / whole, (two * a - one * b) / whole
        return [
            needed[joint] + first[joint] * swivel + second[joint] * across
            for joint in range(joints)
        ]
