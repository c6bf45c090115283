"""Reader of meshes: by a file's ending, whatever is in it."""

from pathlib import Path

from labcrane.limits import LimitError, check_size
from labcrane.machines.meshes import FORMATS
from labcrane.machines.meshes.gltf import read_glb, read_gltf
from labcrane.machines.meshes.obj import read_obj
from labcrane.machines.meshes.stl import read_stl
from labcrane.machines.meshes.surface import MeshError, Surface


def read_surfaces(path: Path) -> list[Surface]:
    """Return the triangles of a mesh file; of a glTF file, those of each part.

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
    if solid := [surface for surface in found if len(surface.faces)]:
        return solid
    raise MeshError(f"mesh {str(path)!r} holds no triangles; export its surface")


def _read(path: Path) -> list[Surface]:
    data = path.read_bytes()
    match path.suffix.lower():
        case ".stl":
            return [read_stl(data)]
        case ".obj":
            return [read_obj(data)]
        case ".glb":
            return read_glb(data, path.parent)
        case ".gltf":
            return read_gltf(data, path.parent)
    raise MeshError(f"is of none of the formats that are read: {', '.join(FORMATS)}")
