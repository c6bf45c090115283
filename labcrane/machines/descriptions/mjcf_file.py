"""MJCF file as MuJoCo compiles it: bodies with their masses, hinges with their axes.

A joint that a study does not name stays where the file has it; one that an ``equality`` moves on
the way to the tip is refused. MJCF has no largest speeds: the protocol gives them, and torques
where the file has none.
"""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from labcrane.errors import nearest
from labcrane.machines.descriptions.chain import Axis, ChainError, Mass, coupled, together
from labcrane.machines.descriptions.robot_xml import check_robot
from labcrane.types import FloatArray


class MjcfFile:
    """Content of an MJCF file.

    Parameters
    ----------
    folder
        Of the study: whatever the file names lies in it.

    Raises
    ------
    ChainError
        MuJoCo is not installed, or refuses the file; the message has its words.
    """

    def __init__(self, path: Path, folder: Path) -> None:
        check_robot(path, folder)
        try:
            import mujoco  # noqa: PLC0415 - an engine, which not everybody has
        except ImportError as error:
            raise ChainError(
                "MJCF is read by MuJoCo, which is not installed: pip install mujoco"
            ) from error
        try:
            self._model = mujoco.MjModel.from_xml_path(str(path))
        except ValueError as error:
            raise ChainError(f"MuJoCo cannot read it: {error}") from error
        self._kinds = mujoco.mjtJoint
        self._data = mujoco.MjData(self._model)
        self._names = [self._model.joint(at).name for at in range(self._model.njnt)]
        self._mujoco = mujoco
        self.title = path.stem

    @property
    def joint_names(self) -> list[str]:
        """The joints that turn."""
        hinge = int(self._kinds.mjJNT_HINGE)
        return [
            name
            for name, kind in zip(self._names, self._model.jnt_type, strict=True)
            if kind == hinge
        ]

    def axes(
        self,
        names: Mapping[str, str],
        tip: str,
        speeds: Mapping[str, float],
        efforts: Mapping[str, float],
    ) -> Sequence[Axis]:
        """Return joints by the study's names, which are the keys of ``names``, outward to the tip.

        ``speeds`` in rad/s and ``efforts`` in N m replace limits that the file lacks.
        """
        for name in names.values():
            if name not in self.joint_names:
                raise ChainError(
                    f"there is no hinge {name!r}; {nearest(name, self.joint_names, 'it has')}",
                    name=name,
                )
        self._at_zero(names)
        bodies = {int(self._model.joint(name).bodyid[0]): name for name in names.values()}
        way = [bodies[body] for body in self._way(self._body_of(tip)) if body in bodies]
        if way != list(names.values()):
            raise ChainError(
                f"the joints on the way to {tip!r} are {', '.join(way) or 'none'} of those named; "
                "name them in this order, one to a body"
            )
        self._check_coupled(names.values(), tip)
        moved: dict[str, list[int]] = {name: [] for name in way}
        for body in range(1, self._model.nbody):
            for above in reversed(self._way(body)):
                if above in bodies:
                    moved[bodies[above]].append(body)
                    break
        return [
            self._axis(called, name, moved[name], speeds, efforts) for called, name in names.items()
        ]

    def _check_coupled(self, driven: Collection[str], tip: str) -> None:
        """Refuse joints on the way to the tip that an ``equality`` of the file moves or holds.

        A joint elsewhere that follows one of them moves neither the tip nor what is driven.
        """
        way = set(self._way(self._body_of(tip)))
        ours = {at for at, body in enumerate(self._model.jnt_bodyid) if int(body) in way}
        passive = {at for at in ours if self._names[at] not in driven}
        for at in np.flatnonzero(self._model.eq_active0):
            kind = self._mujoco.mjtEq(self._model.eq_type[at])
            tied = self._tied(int(at), kind)
            if kind == self._mujoco.mjtEq.mjEQ_JOINT and len(tied) == 1:
                tied -= self._kept(int(at), passive)
            bound = [*sorted(tied & passive), *sorted(tied & ours - passive)]
            if tied & passive or len(bound) > 1 or (bound and len(tied) == 1):
                others = " and ".join(self._names[each] for each in sorted(tied - {bound[0]}))
                what = f"equality: {kind.name.removeprefix('mjEQ_').lower()}"
                raise coupled(self._names[bound[0]], others, what)

    def _tied(self, at: int, kind: Any) -> set[int]:
        """Return the joints that one equality makes move together."""
        model, kinds = self._model, self._mujoco.mjtEq
        ends = [int(each[at]) for each in (model.eq_obj1id, model.eq_obj2id)]
        if kind == kinds.mjEQ_JOINT:
            return {each for each in ends if each >= 0}
        if kind == kinds.mjEQ_TENDON:
            return {joint for tendon in ends if tendon >= 0 for joint in self._counted(tendon)}
        if kind not in {kinds.mjEQ_CONNECT, kinds.mjEQ_WELD}:
            return set()
        if model.eq_objtype[at] == self._mujoco.mjtObj.mjOBJ_SITE:
            ends = [int(model.site_bodyid[each]) for each in ends]
        return self._between(ends)

    def _kept(self, at: int, passive: Collection[int]) -> set[int]:
        """Return the joint that an equality holds where the file has it: it stays here too."""
        held = int(self._model.eq_obj1id[at])
        return {held} if held in passive and self._model.eq_data[at, 0] == 0.0 else set()

    def _between(self, bodies: Sequence[int]) -> set[int]:
        """Return the joints that move some of the bodies and not all: a loop would be of these."""
        above = [set(self._way(each)) for each in bodies]
        loop = set[int]().union(*above) - above[0].intersection(*above)
        return {joint for joint, body in enumerate(self._model.jnt_bodyid) if int(body) in loop}

    def _counted(self, tendon: int) -> set[int]:
        """Return the joints that a tendon counts, or that move a part of its way through space."""
        model, wraps = self._model, self._mujoco.mjtWrap
        start = int(model.tendon_adr[tendon])
        joints: set[int] = set()
        bodies: list[int] = []
        for at in range(start, start + int(model.tendon_num[tendon])):
            part = int(model.wrap_objid[at])
            match wraps(model.wrap_type[at]):
                case wraps.mjWRAP_JOINT:
                    joints.add(part)
                case wraps.mjWRAP_SITE:
                    bodies.append(int(model.site_bodyid[part]))
                case wraps.mjWRAP_SPHERE | wraps.mjWRAP_CYLINDER:
                    bodies.append(int(model.geom_bodyid[part]))
        return joints | (self._between(bodies) if bodies else set())

    def tip(self, name: str) -> FloatArray:
        """Return where a site or the origin of a body is at zero, in m, shape ``(3,)``."""
        site = self._id("SITE", name)
        if site >= 0:
            return np.array(self._data.site_xpos[site])
        return np.array(self._data.xpos[self._body_of(name)])

    def _axis(
        self,
        called: str,
        name: str,
        bodies: Sequence[int],
        speeds: Mapping[str, float],
        efforts: Mapping[str, float],
    ) -> Axis:
        model, at = self._model, self._names.index(name)
        if not model.jnt_limited[at]:
            raise ChainError(f"joint {name!r} has no range; give it one in the file")
        if called not in speeds:
            raise ChainError(
                f"joint {name!r} has no largest speed, as MJCF has none; give it in the protocol, "
                "under speeds_deg_s"
            )
        effort = efforts.get(called) or float(np.abs(model.jnt_actfrcrange[at]).max())
        if effort <= 0.0:
            raise ChainError(
                f"joint {name!r} has no effort; give it in the protocol, under efforts"
            )
        carries = together([self._mass(body) for body in bodies])
        lowest, highest = (float(each) for each in model.jnt_range[at])
        return Axis(
            name,
            called,
            np.array(self._data.xanchor[at]),
            np.array(self._data.xaxis[at]),
            (lowest, highest),
            speeds[called],
            effort,
            carries,
        )

    def _mass(self, body: int) -> Mass:
        turn = self._data.ximat[body].reshape(3, 3)
        inertia = turn @ np.diag(self._model.body_inertia[body]) @ turn.T
        return Mass(float(self._model.body_mass[body]), np.array(self._data.xipos[body]), inertia)

    def _at_zero(self, names: Mapping[str, str]) -> None:
        self._data.qpos[:] = self._model.qpos0
        for name in names.values():
            self._data.qpos[self._model.joint(name).qposadr[0]] = 0.0
        self._mujoco.mj_kinematics(self._model, self._data)
        self._mujoco.mj_comPos(self._model, self._data)

    def _way(self, body: int) -> list[int]:
        way: list[int] = []
        while body > 0:
            way.append(body)
            body = int(self._model.body_parentid[body])
        return way[::-1]

    def _body_of(self, name: str) -> int:
        site = self._id("SITE", name)
        if site >= 0:
            return int(self._model.site_bodyid[site])
        body = self._id("BODY", name)
        if body < 0:
            there: list[Any] = [self._model.body(at).name for at in range(1, self._model.nbody)]
            listed = nearest(name, there, "it has")
            raise ChainError(f"there is no site or body {name!r}; {listed}", name=name)
        return body

    def _id(self, kind: str, name: str) -> int:
        objects = self._mujoco.mjtObj
        return int(self._mujoco.mj_name2id(self._model, getattr(objects, f"mjOBJ_{kind}"), name))
