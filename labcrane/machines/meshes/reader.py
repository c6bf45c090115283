"""Reader of meshes: by a file's ending, whatever is in it."""

from pathlib import Path

from labcrane.limits import LimitError, check_size
from labcrane.machines.meshes import FORMATS
from labcrane.machines.meshes.obj import read_obj
from labcrane.machines.meshes.stl import read_stl
from labcrane.machines.meshes.surface import MeshError, Surface


def read_surface(path: Path) -> Surface:
    """Return the triangles of a mesh file.

    Its own words are read and nothing of the renderer's: a file of strangers may be damaged in any
    way. Time and memory grow no faster than its size, which :data:`labcrane.limits.LIMITS` bounds.

    Raises
    ------
    MeshError
        It cannot be read, is damaged, larger than may be, or holds no triangles; the message names
        it.
    """
    try:
        check_size(path.stat().st_size, "mesh", "the file")
        found = _read(path)
    except LimitError as error:
        raise MeshError(f"mesh {str(path)!r} is too large: {error}") from error
    except MeshError as error:
        raise MeshError(f"mesh {str(path)!r} {error}") from error
    except OSError as error:
        raise MeshError(f"mesh {str(path)!r} cannot be read: {error.strerror}") from error
    if len(found.faces):
        return found
    raise MeshError(f"mesh {str(path)!r} holds no triangles; export its surface")


def _read(path: Path) -> Surface:
    data = path.read_bytes()
    match path.suffix.lower():
        case ".stl":
            return read_stl(data)
        case ".obj":
            return read_obj(data)
    raise MeshError(f"is of none of the formats that are read: {', '.join(FORMATS)}")
