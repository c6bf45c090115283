"""URDF file as it is read: links with their masses, joints with their axes.

Of the format of the Robot Operating System, what says how a machine moves: revolute, continuous and
fixed joints, origins, axes, limits and inertias. A joint that a study does not name stays at zero;
one that follows another on the way to the tip is refused.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from labcrane.errors import nearest
from labcrane.files.system import is_file
from labcrane.machines.descriptions.chain import (
    Axis,
    ChainError,
    LinkMesh,
    Mass,
    together,
)
from labcrane.machines.descriptions.robot_xml import read_robot
from labcrane.machines.machine import impossible
from labcrane.types import FloatArray

TURNING = ("revolute", "continuous")
MOST_LINKS = 500
"""Of a robot; a person with all fingers has a fifth of them."""

WHOLE_TURN = (-math.pi, math.pi)


class UrdfFile:
    """Content of a URDF file.

    Parameters
    ----------
    folder
        Of the study: meshes are named from there.
    meshes
        Whether links look like their meshes.

    Raises
    ------
    ChainError
        It is not URDF, or its links do not form a tree.
    """

    def __init__(self, path: Path, folder: Path, *, meshes: bool = True) -> None:
        self._path, self._folder, self._meshes = path.resolve(), folder.resolve(), meshes
        root = read_robot(path)
        if root.tag != "robot":
            raise ChainError(f"it is not URDF: its root is <{root.tag}> and must be <robot>")
        if any("xacro" in str(each.tag) for each in root.iter()):
            raise ChainError("it is xacro, not yet URDF; expand it first: xacro FILE > arm.urdf")
        self.title = root.get("name", path.stem)
        self._links = {_name(each): each for each in root.findall("link")}
        self._joints = {_name(each): each for each in root.findall("joint")}
        if len(self._links) > MOST_LINKS:
            raise ChainError(
                f"it has {len(self._links)} links; the maximum is {MOST_LINKS}: remove those that "
                "do not move"
            )
        self._above: dict[str, str] = {}
        for name, joint in self._joints.items():
            child, parent = _link(joint, "child"), _link(joint, "parent")
            for link in (child, parent):
                if link not in self._links:
                    raise ChainError(f"joint {name!r} names a link {link!r} that is not there")
            if child in self._above:
                raise ChainError(f"link {child!r} hangs on two joints; a tree is needed")
            self._above[child] = name
        self._poses = {name: self._pose(name, set()) for name in self._links}

    @property
    def joint_names(self) -> list[str]:
        """The joints that turn."""
        return [name for name, each in self._joints.items() if each.get("type") in TURNING]

    def tip(self, link: str) -> FloatArray:
        """Return where the origin of a link is at zero, in m, shape ``(3,)``."""
        if link not in self._links:
            there = nearest(link, self._links, "it has")
            raise ChainError(f"there is no link {link!r}; {there}", name=link)
        return self._poses[link][:3, 3]

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
            if name not in self._joints:
                there = nearest(name, self.joint_names, "it has")
                raise ChainError(f"there is no joint {name!r}; {there}", name=name)
        self.tip(tip)  # refused first, if it is not there
        way = self._way(tip)
        in_order = [name for name in way if name in names.values()]
        if in_order != list(names.values()):
            raise ChainError(
                f"the joints on the way to {tip!r} are {', '.join(way)}; name them in this order"
            )
        self._check_coupled(way, in_order)
        moved = self._moved(in_order)
        return [
            self._axis(called, name, moved[name], speeds, efforts) for called, name in names.items()
        ]

    def _check_coupled(self, way: Sequence[str], driven: Sequence[str]) -> None:
        """Refuse joints on the way to the tip that move as another does (``mimic``).

        One that follows a joint which stays at zero stays too, unless it has an offset.
        """
        for name in way:
            leader, apart, seen = name, False, {name}
            while (mimic := self._joints[leader].find("mimic")) is not None:
                apart |= _number(mimic.attrib, "offset", leader, 0.0) != 0.0
                leader = mimic.get("joint", "")
                if leader not in self._joints or leader in seen:
                    raise ChainError(
                        f"joint {name!r} mimics {leader!r}, which is not there or mimics it",
                        name=name,
                    )
                seen.add(leader)
            if leader != name and (name in driven or leader in driven or apart):
                raise ChainError(
                    f"joint {name!r} on the way to the tip moves with {leader} (mimic), which is "
                    "not followed here: the tip would be somewhere else; name a tip before it, or "
                    "a file without this coupling",
                    name=name,
                )

    def _axis(
        self,
        called: str,
        name: str,
        links: Sequence[str],
        speeds: Mapping[str, float],
        efforts: Mapping[str, float],
    ) -> Axis:
        joint = self._joints[name]
        if (kind := joint.get("type")) not in TURNING:
            raise ChainError(f"joint {name!r} is {kind}, and must be revolute")
        limit = joint.find("limit")
        given: Mapping[str, str] = {} if limit is None else limit.attrib
        limits = (
            WHOLE_TURN
            if kind == "continuous"
            else (_number(given, "lower", name, 0.0), _number(given, "upper", name, 0.0))
        )
        pose = self._poses[_link(joint, "child")]
        if limits[0] >= limits[1]:
            raise ChainError(
                f"joint {name!r} goes from {limits[0]:g} to {limits[1]:g} rad by its limit; lower "
                "and upper are 0 where they are not written"
            )
        direction = pose[:3, :3] @ _vector(joint.find("axis"), "xyz", (1.0, 0.0, 0.0))
        if not np.any(direction):
            raise ChainError(f"joint {name!r} has the axis 0 0 0, which is not a direction")
        carries = together([self._mass(each) for each in links])
        if carries.mass <= 0.0:
            raise ChainError(f"nothing that moves with joint {name!r} has a mass")
        return Axis(
            name,
            called,
            pose[:3, 3],
            direction / np.linalg.norm(direction),
            limits,
            speeds[called] if called in speeds else _positive(given, "velocity", name),
            efforts[called] if called in efforts else _positive(given, "effort", name),
            carries,
            self._look(_link(joint, "child")) if self._meshes else None,
        )

    def _look(self, link: str) -> LinkMesh | None:
        """Return the first mesh of a link; None of one that is drawn of simple shapes."""
        for visual in self._links[link].findall("visual"):
            mesh = visual.find("geometry/mesh")
            if mesh is None:
                continue
            scale = _vector(mesh, "scale", (1.0, 1.0, 1.0))
            if not np.allclose(scale, scale[0]) or scale[0] <= 0.0:
                raise ChainError(
                    f"the mesh of {link!r} is scaled by {mesh.get('scale')}, which must be the "
                    "same along x, y and z; or write meshes: false"
                )
            file = self._found(mesh.get("filename", ""), link)
            return LinkMesh(file, float(scale[0]), self._poses[link] @ _origin(visual))
        return None

    def _found(self, written: str, link: str) -> str:
        """Return a mesh's path from the folder of the study: also of ``package://name/...``."""
        inside = written.removeprefix("file://")
        if inside.startswith("package://"):
            inside = inside.removeprefix("package://").partition("/")[2]
        for above in (self._path.parent, *self._path.parent.parents):
            if not above.is_relative_to(self._folder):
                break
            if is_file(above / inside):
                return (above / inside).relative_to(self._folder).as_posix()
        raise ChainError(
            f"the mesh {written!r} of {link!r} is not next to the file or in a folder above it; "
            "put it into the study's folder, or write meshes: false"
        )

    def _moved(self, names: Sequence[str]) -> dict[str, list[str]]:
        """Return the links that move with each of the joints and with none behind it."""
        moved: dict[str, list[str]] = {name: [] for name in names}
        for link in self._links:
            for joint in reversed(self._way(link)):
                if joint in moved:
                    moved[joint].append(link)
                    break
        return moved

    def _way(self, link: str) -> list[str]:
        """Return the joints from the base to a link."""
        way: list[str] = []
        while link in self._above:
            joint = self._above[link]
            way.append(joint)
            link = _link(self._joints[joint], "parent")
        return way[::-1]

    def _pose(self, link: str, seen: set[str]) -> FloatArray:
        if link in seen:
            raise ChainError(f"link {link!r} hangs on itself; a tree is needed")
        if link not in self._above:
            return np.eye(4)
        joint = self._joints[self._above[link]]
        return self._pose(_link(joint, "parent"), {*seen, link}) @ _origin(joint)

    def _mass(self, link: str) -> Mass:
        inertial = self._links[link].find("inertial")
        if inertial is None:
            return Mass(0.0, self._poses[link][:3, 3], np.zeros((3, 3)))
        pose = self._poses[link] @ _origin(inertial)
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        moments = {} if inertia is None else inertia.attrib
        given = ixx, iyy, izz, ixy, ixz, iyz = tuple(
            _number(moments, key, link, 0.0) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        own = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
        attributes: Mapping[str, str] = {} if mass is None else mass.attrib
        weighs = _number(attributes, "value", link, 0.0)
        if weighs < 0.0:
            raise ChainError(f"link {link!r} has a mass of {weighs:g} kg; it must not be negative")
        if (weighs > 0.0 or own.any()) and (why := impossible(given)):
            raise ChainError(f"link {link!r} {why}; correct its <inertia>")
        return Mass(weighs, pose[:3, 3], pose[:3, :3] @ own @ pose[:3, :3].T)


def _name(element: ElementTree.Element) -> str:
    if name := element.get("name"):
        return name
    raise ChainError(f"a <{element.tag}> has no name")


def _link(joint: ElementTree.Element, which: str) -> str:
    found = joint.find(which)
    if found is None or not found.get("link"):
        raise ChainError(f"joint {_name(joint)!r} has no {which}")
    return str(found.get("link"))


def _origin(element: ElementTree.Element) -> FloatArray:
    """Return the pose of an element in its parent, shape ``(4, 4)``: fixed axes, x, y, then z."""
    origin = element.find("origin")
    roll, pitch, yaw = _vector(origin, "rpy", (0.0, 0.0, 0.0))
    pose = np.eye(4)
    pose[:3, :3] = _turn(2, yaw) @ _turn(1, pitch) @ _turn(0, roll)
    pose[:3, 3] = _vector(origin, "xyz", (0.0, 0.0, 0.0))
    return pose


def _turn(axis: int, angle: float) -> FloatArray:
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[first, first] = turn[second, second] = math.cos(angle)
    turn[second, first], turn[first, second] = math.sin(angle), -math.sin(angle)
    return turn


def _vector(
    element: ElementTree.Element | None, key: str, otherwise: tuple[float, float, float]
) -> FloatArray:
    written = None if element is None else element.get(key)
    if written is None:
        return np.array(otherwise)
    try:
        vector = np.array([float(part) for part in written.split()])
    except ValueError:
        vector = np.array([])
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise ChainError(f"{key}={written[:40]!r} must be three numbers")
    return vector


def _number(given: Mapping[str, Any], key: str, of: str, otherwise: float | None = None) -> float:
    if key not in given:
        if otherwise is None:
            raise ChainError(f"{of!r} has no {key}")
        return otherwise
    try:
        number = float(given[key])
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ChainError(f"{of!r}: {key}={str(given[key])[:40]!r} is not a number")
    return number


def _positive(given: Mapping[str, Any], key: str, of: str) -> float:
    number = _number(given, key, of, 0.0)
    if number <= 0.0:
        what = "speeds_deg_s" if key == "velocity" else "efforts"
        raise ChainError(f"joint {of!r} has no {key}; give it in the protocol, under {what}")
    return number
