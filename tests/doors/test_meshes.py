"""Meshes of strangers: read as assimp reads what is whole, refused in words when damaged."""

import json
import random
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from doors.fuzz import CORPUS
from needs import GRAPHICS, needs

from labcrane.limits import LIMITS
from labcrane.machines import MeshError, read_surface


def corners(surface) -> list[tuple[float, ...]]:
    """Return all triangles as nine numbers each, from their lowest corner on, in order."""
    found = []
    for triangle in np.round(surface.points[surface.faces], 2) + 0.0:
        rows = [tuple(corner) for corner in triangle.tolist()]
        at = rows.index(min(rows))
        found.append((*rows[at], *rows[at - 2], *rows[at - 1]))
    return sorted(found)


ASSIMP = """
import json, sys
from panda3d import core
core.load_prc_file_data("test", "load-file-type p3assimp")
path = core.Filename.from_os_specific(sys.argv[1])
options = core.LoaderOptions(core.LoaderOptions.LF_no_cache)
root = core.Loader.get_global_ptr().load_sync(path, options)
top, found = core.NodePath(root), []
for node in top.find_all_matches("**/+GeomNode"):
    place = node.get_mat(top)
    for number in range(node.node().get_num_geoms()):
        geometry = node.node().get_geom(number).decompose()
        reader = core.GeomVertexReader(geometry.get_vertex_data(), "vertex")
        for each in range(geometry.get_num_primitives()):
            primitive = geometry.get_primitive(each)
            for at in range(primitive.get_num_vertices()):
                reader.set_row(primitive.get_vertex(at))
                found.append([round(x, 2) + 0.0 for x in place.xform_point(reader.get_data3())])
print(json.dumps(found))
"""


def by_assimp(path: Path) -> list[tuple[float, ...]]:
    """Return a file's triangles as the renderer's own reader has them."""
    done = subprocess.run(
        [sys.executable, "-c", ASSIMP, str(path)], capture_output=True, check=True
    )
    points = json.loads(done.stdout.splitlines()[-1])
    found = []
    for at in range(0, len(points), 3):
        rows = [tuple(point) for point in points[at : at + 3]]
        low = rows.index(min(rows))
        found.append((*rows[low], *rows[low - 2], *rows[low - 1]))
    return sorted(found)


def a_polyhedron(dice: random.Random) -> bytes:
    """Return an OBJ file with polygons, backward numbers, textures and normals at random."""
    count = dice.randrange(6, 20)
    lines = [" ".join(["v", *(f"{dice.uniform(-9, 9):.4f}" for _ in "xyz")]) for _ in range(count)]
    lines += ["vt 0 0", "vn 0 0 1", "g part", "s off"]
    for _ in range(6):
        chosen = dice.sample(range(count), 3)
        names = [str(at + 1 if dice.random() < 0.5 else at - count) for at in chosen]
        ending = dice.choice(["", "/1", "//1", "/1/1"])
        lines.append(" ".join(["f", *(name + ending for name in names)]))
    return "\n".join(lines).encode() + b"\n"


def a_soup(dice: random.Random) -> bytes:
    """Return a packed STL file of triangles at random."""
    rows = [struct.pack("<12fH", *(dice.uniform(-9, 9) for _ in range(12)), 0) for _ in range(9)]
    return bytes(80) + struct.pack("<I", len(rows)) + b"".join(rows)


def a_written_soup(dice: random.Random) -> bytes:
    lines = ["solid of triangles"]
    for _ in range(9):
        lines += ["facet normal 0 0 1", "outer loop"]
        lines += [" ".join(["vertex", *(f"{dice.uniform(-9, 9):e}" for _ in "xyz")]) for _ in "abc"]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid"]).encode()


MADE = {"obj": a_polyhedron, "stl": a_soup, "written.stl": a_written_soup}


@needs(*GRAPHICS)
@pytest.mark.parametrize("kind", MADE)
def test_what_is_whole_is_read_as_assimp_reads_it(kind: str, tmp_path: Path) -> None:
    for seed in range(3):
        path = tmp_path / f"{seed}.{kind}"
        path.write_bytes(MADE[kind](random.Random(seed)))
        np.testing.assert_allclose(corners(read_surface(path)), by_assimp(path), atol=0.011)


@pytest.mark.parametrize("kind", MADE)
def test_a_file_that_is_cut_off_is_never_a_smaller_mesh(kind: str, tmp_path: Path) -> None:
    """An OBJ file has no end of its own: it may be cut between its lines, and in a number."""
    data = MADE[kind](random.Random(7))
    path = tmp_path / f"cut.{kind}"
    whole = len(data)
    for length in range(0, whole - 9, max(1, whole // 150)):
        path.write_bytes(data[:length])
        if kind == "obj":
            try:
                read_surface(path)
            except MeshError:
                continue
            assert b"\nf" in data[:length]
        else:
            with pytest.raises(MeshError, match="cut"):
                read_surface(path)


def test_a_polygon_of_too_many_triangles_is_refused_before_they_are_made(tmp_path: Path) -> None:
    most = LIMITS["triangles of a mesh"].most
    (tmp_path / "many.obj").write_text("v 0 0 0\nf " + "1 " * (most + 3))
    with pytest.raises(MeshError, match=rf"{most + 1} triangles; the maximum is {most}"):
        read_surface(tmp_path / "many.obj")


def test_a_polygon_is_a_fan_and_corners_need_not_name_normals(tmp_path: Path) -> None:
    path = tmp_path / "square.obj"
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\n"
    path.write_text(square + "f 1//1 2//1 \\\n 3//1 4//-1 # a square\n")
    surface = read_surface(path)
    assert surface.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    np.testing.assert_array_equal(surface.normals, [[0, 0, 1]] * 4)
    path.write_text(square + "f 1//1 2//1 3//1\nf 1 3 4\n")
    surface = read_surface(path)
    assert surface.normals is None
    assert surface.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("f 1 2 9", "corners that are not among its 3 points"),
        ("f 1 2 -9", "a corner in line 4 that refers to no point"),
        ("f 1 2 0", "a corner in line 4 that refers to no point"),
        ("f 1//1/1 2//1 3//1", "a corner in line 4 that refers to no point"),
        ("f 1 2 " + "9" * 5000, "a corner in line 4 that refers to no point"),
        ("f 1 2 99999999999999999999", "a corner in line 4 that refers to no point"),
        ("f 1 2", "a polygon with fewer than three corners in line 4"),
        ("v 1 2", "a point or normal without three numbers in line 4"),
        ("v 1 2 x", "a value that is not a number in line 4"),
        ("q 1 2 3", "'q' in line 4, which does not describe flat polygons"),
    ],
)
def test_a_line_that_is_none_is_named(line: str, why: str, tmp_path: Path) -> None:
    path = tmp_path / "line.obj"
    path.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\n{line}\nf 1 2 3\n")
    with pytest.raises(MeshError, match=rf"^mesh '.*line\.obj' has .*{why}"):
        read_surface(path)


def test_the_corpus_is_whole() -> None:
    for name in ("stl", "obj"):
        assert list((CORPUS / name).iterdir())
