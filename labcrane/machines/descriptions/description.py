"""Description of a machine in a protocol: a URDF file, and which joints are driven."""

import json
import math
from pathlib import Path

from pydantic import Field, PositiveFloat, ValidationError

from labcrane.errors import ProtocolError, nearest
from labcrane.files.model import StrictModel
from labcrane.files.system import is_file
from labcrane.machines.machine import FEWEST_JOINTS, Machine


class MachineDescription(StrictModel):
    """A machine of another program's file: ``{urdf: arm.urdf, joints: [...], tip: hook}``."""

    urdf: str
    """A URDF file; paths are relative to the protocol's folder."""

    joints: tuple[str, ...] | dict[str, str] = Field(min_length=FEWEST_JOINTS)
    """Joints that are driven, from the base outward, by their names in the file; as a mapping, the
    study's names for them come first: ``{slew: joint_1}``."""

    tip: str
    """Link whose origin is the tip."""

    title: str = ""
    """Name of the machine; the name in the file by default."""

    rest_deg: dict[str, float] = Field(default_factory=dict)
    """Joint angles at which a session begins, in degrees, by the study's names; 0 by default."""

    speeds_deg_s: dict[str, PositiveFloat] = Field(default_factory=dict)
    """Largest joint speeds, in degrees per second, instead of the file's."""

    efforts: dict[str, PositiveFloat] = Field(default_factory=dict)
    """Largest joint torques, in newton metres, instead of the file's."""

    thickness: PositiveFloat = 0.1
    """Height and width of the beams that replace links, in metres."""

    meshes: bool = True
    """Whether links look like the first mesh that a URDF file gives them: STL or OBJ."""

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
        from labcrane.machines.descriptions.urdf_file import UrdfFile  # noqa: PLC0415

        path = folder / self.urdf
        if not is_file(path):
            raise ProtocolError(
                f"machine file {str(path)!r} does not exist; paths are relative to the protocol's "
                "folder",
                at=("urdf",),
            )
        self._check_names()
        try:
            found = UrdfFile(path, folder, meshes=self.meshes)
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
