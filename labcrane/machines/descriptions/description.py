"""Description of a machine in a protocol: a URDF or MJCF file, and which joints are driven."""

import json
import math
from pathlib import Path
from typing import Any

from pydantic import Field, PositiveFloat, ValidationError, model_validator

from labcrane.errors import ProtocolError, nearest
from labcrane.files.complaints import WrongKey
from labcrane.files.model import StrictModel
from labcrane.files.system import is_file
from labcrane.machines.machine import FEWEST_JOINTS, Machine


class MachineDescription(StrictModel):
    """A machine of another program's file: ``{urdf: arm.urdf, joints: [...], tip: hook}``."""

    urdf: str | None = None
    """A URDF file; paths are relative to the protocol's folder."""

    mjcf: str | None = None
    """An MJCF file, which is read by MuJoCo."""

    joints: tuple[str, ...] | dict[str, str] = Field(min_length=FEWEST_JOINTS)
    """Joints that are driven, from the base outward, by their names in the file; as a mapping, the
    study's names for them come first: ``{slew: joint_1}``."""

    tip: str
    """Link (URDF), site or body (MJCF) whose origin is the tip."""

    title: str = ""
    """Name of the machine; the name in the file by default."""

    rest_deg: dict[str, float] = Field(default_factory=dict)
    """Joint angles at which a session begins, in degrees, by the study's names; 0 by default."""

    speeds_deg_s: dict[str, PositiveFloat] = Field(default_factory=dict)
    """Largest joint speeds, in degrees per second, instead of the file's; MJCF has none."""

    efforts: dict[str, PositiveFloat] = Field(default_factory=dict)
    """Largest joint torques, in newton metres, instead of the file's."""

    thickness: PositiveFloat = 0.1
    """Height and width of the beams that replace links, in metres."""

    meshes: bool = True
    """Whether links look like the first mesh that a URDF file gives them: STL or OBJ."""

    @model_validator(mode="after")
    def _is_one_file(self) -> "MachineDescription":
        if (self.urdf is None) == (self.mjcf is None):
            at = () if self.urdf is None else ("mjcf",)
            raise WrongKey("a machine is described by one file; write urdf or mjcf", at=at)
        return self

    def _check_names(self) -> None:
        for key in ("rest_deg", "speeds_deg_s", "efforts"):
            for name in getattr(self, key):
                if name not in self.names:
                    there = nearest(name, self.names, "its joints are")
                    raise ProtocolError(f"{key} names {name!r}; {there}", at=(key, name))

    def place(self, name: str) -> tuple[str | int, ...]:
        """Return where the protocol has a name, of the file or of the study's own for a joint."""
        for at, (own, joint) in enumerate(self.names.items()):
            if name in {own, joint}:
                return ("joints", own if isinstance(self.joints, dict) else at)
        return ("tip",) if name == self.tip else ()

    @property
    def names(self) -> dict[str, str]:
        """The file's names of joints by the study's."""
        if isinstance(self.joints, dict):
            return self.joints
        return {name: name for name in self.joints}

    @property
    def file(self) -> str:
        """The file that describes it."""
        return self.urdf or self.mjcf or ""

    def read(self, folder: Path) -> tuple[Machine, str]:
        """Return the machine, and its own YAML.

        Raises
        ------
        ProtocolError
            The file is not there, or is of another kind of machine.
        """
        # A study with a machine of labcrane's own is checked without NumPy.
        from labcrane.machines.descriptions.chain import (  # noqa: PLC0415
            ChainError,
            machine_fields,
            rounding,
        )

        path = folder / self.file
        if not is_file(path):
            raise ProtocolError(
                f"machine file {str(path)!r} does not exist; paths are relative to the protocol's "
                "folder",
                at=("mjcf" if self.urdf is None else "urdf",),
            )
        self._check_names()
        try:
            found = self._file(path, folder)
            speeds = {name: math.radians(each) for name, each in self.speeds_deg_s.items()}
            axes = found.axes(self.names, self.tip, speeds, self.efforts)
            tip = found.tip(self.tip)
            fields = machine_fields(axes, tip, self.rest_deg, self.thickness)
            source = f"{path.name}{rounding(axes, tip)}"
        except ChainError as error:
            raise ProtocolError(f"{path}: {error}", at=self.place(error.name)) from error
        fields = {"title": self.title or found.title, "source": source, **fields}
        try:
            machine = Machine.model_validate(fields, context={"folder": folder})
            return machine, json.dumps(fields, indent=1) + "\n"
        except ValidationError as error:
            first = error.errors()[0]
            what, loc = first["msg"].removeprefix("Value error, "), first["loc"]
            named = list(self.names)[int(loc[1])] if loc[0] == "joints" and len(loc) > 1 else ""
            key = next((key for key in ("rest_deg", "speeds_deg_s", "efforts") if key in what), "")
            where = f"joint {named!r}" if named else ".".join(map(str, loc))
            written = key and named in getattr(self, key)
            raise ProtocolError(
                f"{path} as a machine: {where}: {what}",
                at=(key, named) if written else self.place(named),
            ) from error

    def _file(self, path: Path, folder: Path) -> Any:
        if self.urdf is not None:
            from labcrane.machines.descriptions.urdf_file import UrdfFile  # noqa: PLC0415

            return UrdfFile(path, folder, meshes=self.meshes)
        from labcrane.machines.descriptions.mjcf_file import MjcfFile  # noqa: PLC0415

        return MjcfFile(path, folder)
