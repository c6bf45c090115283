"""A mesh for display: a file in the folder of the one that names it."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, PositiveFloat, ValidationInfo

from labcrane.files.model import StrictModel, was_run
from labcrane.files.system import is_file
from labcrane.machines.meshes import FORMATS

Triple = tuple[float, float, float]


def _beside(path: Path, info: ValidationInfo) -> Path:
    """Return the path through the folder of the file that names it."""
    if was_run(info):
        return path  # of a record: where it was, which is another computer's, or gone
    file = info.context["folder"] / path if info.context else path
    if file.suffix.lower() not in FORMATS:
        raise ValueError(f"{str(path)!r} is not a mesh file; use {', '.join(FORMATS)}")
    if not is_file(file):
        raise ValueError(f"there is no mesh {str(file)!r}; paths are relative to its own file")
    # What is read with needs NumPy, which a protocol without meshes does without.
    from labcrane.machines.meshes.reader import read_surface  # noqa: PLC0415

    read_surface(file)  # what is damaged is refused before anybody sits down
    return file


class MeshFile(StrictModel):
    """Visual geometry; it does not change the collision geometry."""

    file: Annotated[Path, AfterValidator(_beside)]
    """STL or OBJ; its axes are taken as they are in the file."""

    scale: PositiveFloat = 1.0
    """Metres per unit of the file: 0.001 for millimetres."""

    position: Triple = (0.0, 0.0, 0.0)
    """Where its origin is, in the frame of the link or thing, in metres."""

    turn_deg: Triple = (0.0, 0.0, 0.0)
    """Turned about the frame's x, then y, then z axis, in degrees."""

    colour: Triple | None = None
    """Red, green and blue, each 0 to 1; that of the machine by default."""


def _written(value: Any) -> Any:
    return {"file": value} if isinstance(value, str) else value


Looks = Annotated[MeshFile, BeforeValidator(_written)]
"""A mesh as it is written: a file, or a mapping with the file and where it is."""
