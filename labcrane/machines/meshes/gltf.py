"""GlTF 2: meshes in a tree of nodes, as JSON with separate numbers or in one file with them."""

import base64
import binascii
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar
from urllib.parse import unquote

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from labcrane.files.system import is_file
from labcrane.limits import check_size
from labcrane.machines.meshes.surface import (
    MeshError,
    Surface,
    check_corners,
    check_triangles,
    doubles,
)
from labcrane.machines.rotation import rotation_matrix
from labcrane.types import FloatArray

MAGIC, VERSION = b"glTF", 2
JSON, BINARY = 0x4E4F534A, 0x004E4942
TRIANGLES, STRIP, FAN = 4, 5, 6
TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
FLOATS = 5126
HARMLESS = ("KHR_materials", "KHR_texture", "KHR_lights", "EXT_texture")
"""Beginnings of the names of extensions that do not concern triangles."""
SINGULAR = 1e-12

_Item = TypeVar("_Item")
Index = Annotated[int, Field(ge=0, le=2**31, strict=True)]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")


class _Buffer(_Model):
    byteLength: Index  # noqa: N815 - as glTF names it
    uri: str | None = None


class _View(_Model):
    buffer: Index
    byteLength: Index  # noqa: N815
    byteOffset: Index = 0  # noqa: N815
    byteStride: Annotated[int, Field(ge=4, le=252)] | None = None  # noqa: N815


class _Accessor(_Model):
    componentType: Literal[5120, 5121, 5122, 5123, 5125, 5126]  # noqa: N815
    count: Index
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    bufferView: Index | None = None  # noqa: N815
    byteOffset: Index = 0  # noqa: N815
    sparse: Any = None


class _Primitive(_Model):
    attributes: dict[str, Index]
    indices: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = TRIANGLES


class _Mesh(_Model):
    primitives: tuple[_Primitive, ...]


class _Node(_Model):
    mesh: Index | None = None
    children: tuple[Index, ...] = ()
    matrix: Annotated[tuple[FiniteFloat, ...], Field(min_length=16, max_length=16)] | None = None
    translation: tuple[FiniteFloat, FiniteFloat, FiniteFloat] = (0.0, 0.0, 0.0)
    rotation: tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat] = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[FiniteFloat, FiniteFloat, FiniteFloat] = (1.0, 1.0, 1.0)


class _Scene(_Model):
    nodes: tuple[Index, ...] = ()


class _Asset(_Model):
    version: Annotated[str, Field(pattern=r"^2\.\d+$")]


class _Tree(_Model):
    asset: _Asset
    scene: Index = 0
    scenes: tuple[_Scene, ...] = ()
    nodes: tuple[_Node, ...] = ()
    meshes: tuple[_Mesh, ...] = ()
    accessors: tuple[_Accessor, ...] = ()
    bufferViews: tuple[_View, ...] = ()  # noqa: N815
    buffers: tuple[_Buffer, ...] = ()
    extensionsRequired: tuple[str, ...] = ()  # noqa: N815


def read_glb(data: bytes, folder: Path) -> list[Surface]:
    """Return the triangles of a GLB file, as :func:`read_gltf` does."""
    if data[:4] != MAGIC or int.from_bytes(data[4:8], "little") != VERSION:
        raise MeshError("is not a GLB file of version 2")
    if int.from_bytes(data[8:12], "little") != len(data):
        raise MeshError("is cut off: it has fewer bytes than it states")
    chunks: list[tuple[int, bytes]] = []
    at = 12
    while at < len(data):
        length, kind = (int.from_bytes(data[at + n : at + n + 4], "little") for n in (0, 4))
        if at + 8 + length > len(data):
            raise MeshError("has a part that is longer than the file")
        chunks.append((kind, data[at + 8 : at + 8 + length]))
        at += 8 + length
    if not chunks or chunks[0][0] != JSON:
        raise MeshError("does not begin with what it holds, as JSON")
    inside = next((part for kind, part in chunks[1:] if kind == BINARY), b"")
    return read_gltf(chunks[0][1], folder, inside)


def read_gltf(data: bytes, folder: Path, inside: bytes = b"") -> list[Surface]:
    """Return the triangles of a glTF file where its nodes put them.

    Parameters
    ----------
    folder
        Its folder; files with its numbers are there or below.
    inside
        The numbers that came in the same file.

    Raises
    ------
    MeshError
        It is not glTF 2, refers to something that does not exist, or needs something that cannot
        be read.
    """
    marks = sum(data.count(mark) for mark in (b",", b"[", b"{"))
    check_size(marks, "values of a mesh", "the mesh")
    try:
        tree = _Tree.model_validate_json(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"])) or "it"
        raise MeshError(f"is not glTF 2: {place[:100]}: {first['msg'][:100]}") from error
    foreign = [name for name in tree.extensionsRequired if not name.startswith(HARMLESS)]
    if foreign:
        raise MeshError(f"needs the extension {foreign[0][:60]!r}; export it without")
    return _File(tree, folder, inside).surfaces()


class _File:
    """Content of a glTF file, by number."""

    def __init__(self, tree: _Tree, folder: Path, inside: bytes) -> None:
        self._tree = tree
        self._folder = folder
        self._inside = inside
        self._buffers: dict[int, bytes] = {}

    def surfaces(self) -> list[Surface]:
        """Return all meshes of the scene in its frame."""
        placed = list(self._placed())
        check_triangles(sum(self._count(mesh) for mesh, _ in placed))
        return [_moved(surface, place) for mesh, place in placed for surface in self._meshes(mesh)]

    def _placed(self) -> Iterator[tuple[int, FloatArray]]:
        """Yield the meshes that nodes show, and where, without recursion: trees may be deep."""
        tree, seen = self._tree, set[int]()
        if tree.scenes:
            roots: Sequence[int] = _at(tree.scenes, tree.scene, "scene").nodes
        else:
            below = {child for node in tree.nodes for child in node.children}
            roots = [number for number in range(len(tree.nodes)) if number not in below]
        waiting = [(root, np.eye(4)) for root in reversed(roots)]
        while waiting:
            number, above = waiting.pop()
            if number in seen:
                raise MeshError(f"has node {number} twice in its tree")
            seen.add(number)
            node = _at(tree.nodes, number, "node")
            place = above @ _matrix(node)
            if node.mesh is not None:
                yield node.mesh, place
            waiting += [(child, place) for child in reversed(node.children)]

    def _primitives(self, mesh: int) -> Iterator[_Primitive]:
        for primitive in _at(self._tree.meshes, mesh, "mesh").primitives:
            if primitive.mode >= TRIANGLES:  # not points or lines
                if "POSITION" not in primitive.attributes:
                    raise MeshError("has triangles without points")
                yield primitive

    def _count(self, mesh: int) -> int:
        """Return at most how many triangles' points a mesh will take, before they are read."""
        accessors, found = self._tree.accessors, 0
        for primitive in self._primitives(mesh):
            points = _at(accessors, primitive.attributes["POSITION"], "accessor").count
            corners = 0
            if primitive.indices is not None:
                corners = _at(accessors, primitive.indices, "accessor").count
            each = 3 if primitive.mode == TRIANGLES else 1
            found += max(points // 3, corners // each) + 1
        return found

    def _meshes(self, mesh: int) -> Iterator[Surface]:
        for primitive in self._primitives(mesh):
            points = doubles(self._values(primitive.attributes["POSITION"], "VEC3"))
            normals = None
            if (asked := primitive.attributes.get("NORMAL")) is not None:
                normals = doubles(self._values(asked, "VEC3"))
                if normals.shape != points.shape:
                    raise MeshError("has normals for other points than it has")
            corners = np.arange(len(points))
            if primitive.indices is not None:
                corners = self._values(primitive.indices, "SCALAR").reshape(-1).astype(np.int64)
            check_corners(corners, len(points))
            yield Surface(points, normals, _triangles(corners, primitive.mode))

    def _values(self, number: int, kind: str) -> "np.typing.NDArray[Any]":
        """Return the rows of an accessor: floats in threes, or whole numbers."""
        accessor = _at(self._tree.accessors, number, "accessor")
        whole = accessor.componentType != FLOATS
        if accessor.type != kind or whole != (kind == "SCALAR"):
            raise MeshError(f"has values in accessor {number} that are not points or corners")
        if accessor.sparse is not None or accessor.bufferView is None:
            raise MeshError(f"has sparse values in accessor {number}; export it without them")
        view = _at(self._tree.bufferViews, accessor.bufferView, "buffer view")
        dtype = np.dtype((TYPES[accessor.componentType], (3 if kind == "VEC3" else 1,)))
        raw = self._buffer(view.buffer)
        if view.byteOffset + view.byteLength > len(raw):
            raise MeshError(f"has a buffer view {accessor.bufferView} beyond its buffer")
        stride = view.byteStride or dtype.itemsize
        needs = (accessor.count - 1) * stride + dtype.itemsize if accessor.count else 0
        if stride < dtype.itemsize or accessor.byteOffset + needs > view.byteLength:
            raise MeshError(f"has values beyond its buffer view, in accessor {number}")
        shape = (accessor.count, dtype.shape[0])
        start = view.byteOffset + accessor.byteOffset
        steps = (stride, dtype.base.itemsize)
        return np.ndarray(shape, dtype.base, raw, start, steps)  # looks into raw, and no further

    def _buffer(self, number: int) -> bytes:
        if number not in self._buffers:
            buffer = _at(self._tree.buffers, number, "buffer")
            raw = self._inside if buffer.uri is None else self._fetched(buffer.uri)
            if len(raw) < buffer.byteLength:
                raise MeshError(f"has fewer bytes in buffer {number} than it states")
            self._buffers[number] = raw
            held = sum(map(len, self._buffers.values()))
            check_size(held, "mesh", "the mesh with the files that it names")
        return self._buffers[number]

    def _fetched(self, uri: str) -> bytes:
        """Return the data at an address: inline, or a file in the mesh's folder or below."""
        if uri.startswith("data:"):
            head, _, text = uri.partition(",")
            if not head.endswith(";base64"):
                raise MeshError("has numbers in its text that are not base64")
            try:
                return base64.b64decode(text, validate=True)
            except (binascii.Error, ValueError) as error:
                raise MeshError("has numbers in its text that are not base64") from error
        name = unquote(uri)
        if not name.isprintable() or any(mark in name for mark in (":", "\\")):
            raise MeshError(f"refers to {uri[:60]!r}; its numbers must be in files next to it")
        file, inside = (self._folder / name).resolve(), self._folder.resolve()
        if not file.is_relative_to(inside) or not is_file(file):
            raise MeshError(f"refers to {uri[:60]!r}, which is not a file next to it or below")
        check_size(file.stat().st_size, "mesh", f"{name[:60]!r}")
        return file.read_bytes()


def _at(items: Sequence[_Item], number: int, kind: str) -> _Item:
    if number >= len(items):
        raise MeshError(f"refers to {kind} {number}, but has {len(items)}")
    return items[number]


def _matrix(node: _Node) -> FloatArray:
    """Return where a node is in the one above it, shape ``(4, 4)``."""
    if node.matrix is not None:
        return np.array(node.matrix, np.float64).reshape(4, 4).T  # column by column
    x, y, z, w = node.rotation
    square = x * x + y * y + z * z + w * w
    if not SINGULAR < square < 1.0 / SINGULAR:
        raise MeshError("has a node whose rotation is not a rotation")
    length = math.sqrt(square)
    matrix = np.eye(4)
    turn = rotation_matrix((x / length, y / length, z / length, w / length))
    matrix[:3, :3] = turn * np.array(node.scale)
    matrix[:3, 3] = node.translation
    return matrix


def _moved(surface: Surface, place: FloatArray) -> Surface:
    """Return a surface in the frame of the scene; in a mirror, its triangles are turned over."""
    with np.errstate(all="ignore"):  # what is not finite is refused
        turn = place[:3, :3]
        points = surface.points @ turn.T + place[:3, 3]
        size = float(np.linalg.det(turn)) if np.isfinite(turn).all() else np.nan
    if not np.isfinite(size):
        raise MeshError("has a node whose position is not finite")
    normals = surface.normals
    if normals is not None:
        cube = float(np.abs(turn).max()) ** 3
        if abs(size) > SINGULAR * cube:
            # As a plane's normal is carried along: by the inverse, transposed.
            with np.errstate(all="ignore"):
                normals = normals @ np.linalg.inv(turn)
        else:
            normals = None  # flattened: what lies in it has no other
    faces = surface.faces if size >= 0.0 else surface.faces[:, ::-1]
    return Surface(points, normals, faces)


def _triangles(corners: "np.typing.NDArray[np.int64]", mode: int) -> "np.typing.NDArray[np.int64]":
    """Return corners as triangles, shape ``(m, 3)``, as they are listed, in a strip or a fan."""
    if mode == TRIANGLES:
        if len(corners) % 3:
            raise MeshError("has corners that make no whole triangles")
        return corners.reshape(-1, 3)
    count = max(0, len(corners) - 2)
    if mode == FAN:
        first = np.repeat(corners[:1], count)
        return np.stack([first, corners[1 : 1 + count], corners[2 : 2 + count]], axis=1)
    strip = np.stack([corners[n : n + count] for n in range(3)], axis=1)
    strip[1::2] = strip[1::2, [1, 0, 2]]  # every other one runs the other way round
    return strip
