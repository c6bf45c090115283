"""Meshes of strangers: read as assimp reads what is whole, refused in words when damaged."""

import base64
import json
import random
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from doors.fuzz import CORPUS
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import GRAPHICS, needs

from labcrane.limits import LIMITS
from labcrane.machines import MeshError, read_surfaces


def corners(surfaces) -> list[tuple[float, ...]]:
    """Return all triangles as nine numbers each, from their lowest corner on, in order."""
    found = []
    for surface in surfaces:
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


def a_tree(dice: random.Random) -> bytes:
    """Return a GLB file of meshes in a random tree of moved, turned and stretched nodes."""
    points = np.array([[dice.uniform(-2, 2) for _ in range(3)] for _ in range(12)], "<f4")
    faces = np.array([dice.sample(range(12), 3) for _ in range(8)], "<u2")
    packed = np.zeros(12, [("point", "<f4", 3), ("other", "<f4", 2)])  # with something between
    packed["point"] = points
    numbers = packed.tobytes() + faces.tobytes()
    nodes = []
    for number in range(5):
        quarter = np.array([dice.gauss(0, 1) for _ in range(4)])
        node = {
            "translation": [dice.uniform(-3, 3) for _ in range(3)],
            "rotation": (quarter / np.linalg.norm(quarter)).tolist(),
            "scale": [dice.uniform(0.5, 2.0) for _ in range(3)],
        }
        nodes.append(node | ({"mesh": 0} if number != 1 else {}))
    for child in range(1, 5):
        nodes[dice.randrange(child)].setdefault("children", []).append(child)
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(numbers)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 240, "byteStride": 20},
            {"buffer": 0, "byteOffset": 240, "byteLength": 48},
        ],
        "accessors": [
            {
                "bufferView": 0, "componentType": 5126, "count": 12, "type": "VEC3",
                "min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": 5123, "count": 24, "type": "SCALAR"},
        ],
    }  # fmt: skip
    return glb(tree, numbers)


def glb(tree: object, numbers: bytes = b"") -> bytes:
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    parts = ((text, 0x4E4F534A), (numbers, 0x004E4942))
    body = b"".join(struct.pack("<II", len(part), kind) + part for part, kind in parts)
    return struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body


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


MADE = {"glb": a_tree, "obj": a_polyhedron, "stl": a_soup, "written.stl": a_written_soup}


@needs(*GRAPHICS)
@pytest.mark.parametrize("kind", MADE)
def test_what_is_whole_is_read_as_assimp_reads_it(kind: str, tmp_path: Path) -> None:
    for seed in range(3):
        path = tmp_path / f"{seed}.{kind}"
        path.write_bytes(MADE[kind](random.Random(seed)))
        np.testing.assert_allclose(corners(read_surfaces(path)), by_assimp(path), atol=0.011)


@pytest.mark.parametrize("kind", [name for name in MADE if name != "glb"])
def test_a_file_that_is_cut_off_is_never_a_smaller_mesh(kind: str, tmp_path: Path) -> None:
    """An OBJ file has no end of its own: it may be cut between its lines, and in a number."""
    data = MADE[kind](random.Random(7))
    path = tmp_path / f"cut.{kind}"
    whole = len(data)
    for length in range(0, whole - 9, max(1, whole // 150)):
        path.write_bytes(data[:length])
        if kind == "obj":
            try:
                read_surfaces(path)
            except MeshError:
                continue
            assert b"\nf" in data[:length]
        else:
            with pytest.raises(MeshError, match="cut"):
                read_surfaces(path)


CUBE = {
    "asset": {"version": "2.0"},
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"byteLength": 36}],
}
NUMBERS = np.eye(3, dtype="<f4").tobytes()


def changed(*where: str | int, to: object) -> dict:
    """Return the file of one triangle with one value changed."""
    tree = json.loads(json.dumps(CUBE))
    place = tree
    for step in where[:-1]:
        place = place[step]
    place[where[-1]] = to
    return tree


HUGE = 2_000_000_000
WRONG = {
    "far": (changed("accessors", 0, "count", to=HUGE), "too large"),
    "more": (changed("accessors", 0, "count", to=4), "values beyond its buffer view"),
    "before": (changed("accessors", 0, "count", to=-1), r"accessors\.0\.count"),
    "half": (changed("accessors", 0, "count", to=2.5), r"accessors\.0\.count"),
    "offset": (changed("accessors", 0, "byteOffset", to=HUGE), "values beyond its buffer view"),
    "view": (changed("bufferViews", 0, "byteLength", to=HUGE), "beyond its buffer"),
    "no view": (changed("accessors", 0, "bufferView", to=9), "refers to buffer view 9, but has 1"),
    "no mesh": (changed("nodes", 0, "mesh", to=7), "refers to mesh 7, but has 1"),
    "circle": (changed("nodes", to=[{"children": [1]}, {"children": [2]}, {"children": [1]}]),
               "node 1 twice"),
    "itself": (changed("scenes", to=[{"nodes": [0, 0]}]), "node 0 twice"),
    "draco": (changed("extensionsRequired", to=["KHR_draco_mesh_compression"]), "needs the ext"),
    "old": (changed("asset", "version", to="1.0"), r"asset\.version"),
    "nowhere": (changed("nodes", 0, "scale", to=[1e300, 1e300, 1e300]), "position is not"),
    "no turn": (changed("nodes", 0, "rotation", to=[0, 0, 0, 0]), "is not a rotation"),
    "outside": (changed("buffers", 0, "uri", to="../secret.bin"), "not a file next to it or below"),
    "password": (changed("buffers", 0, "uri", to="/etc/passwd"), "not a file next to it or below"),
    "network": (changed("buffers", 0, "uri", to="http://x.org/a"), "must be in files next to it"),
    "linked": (changed("buffers", 0, "uri", to="linked.bin"), "not a file next to it or below"),
    "long": (changed("buffers", 0, "uri", to="a" * 5000), "not a file next to it or below"),
    "commas": (changed("extras", to=[0] * 1_000_000), "too large"),
    "text": (changed("buffers", 0, "uri", to="data:;base64,@@@@"), "not base64"),
    "points": (changed("accessors", 0, "componentType", to=5125), "that are not points"),
    "sparse": (changed("accessors", 0, "sparse", to={}), "sparse"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_gltf_file_that_says_what_is_not_so_is_refused_in_words(
    case: str, tmp_path: Path
) -> None:
    tree, why = WRONG[case]
    folder = tmp_path / "study"
    folder.mkdir()
    (tmp_path / "secret.bin").write_bytes(NUMBERS)
    (folder / "linked.bin").symlink_to(tmp_path / "secret.bin")
    (folder / "wrong.glb").write_bytes(glb(tree, NUMBERS))
    with pytest.raises(MeshError, match=rf"^mesh '.*wrong\.glb' .*{why}"):
        read_surfaces(folder / "wrong.glb")


def test_what_is_nested_without_end_is_refused(tmp_path: Path) -> None:
    (tmp_path / "deep.gltf").write_bytes(b'{"asset":' + b"[" * 500_000)
    with pytest.raises(MeshError, match=r"deep\.gltf' is not glTF 2"):
        read_surfaces(tmp_path / "deep.gltf")


def test_many_places_of_one_mesh_count_each(tmp_path: Path) -> None:
    """A file of a few kilobytes may ask for more triangles than any memory holds."""
    count = 30_000
    tree = changed("nodes", to=[{"mesh": 0}] * 1000)
    tree["accessors"][0]["count"] = count
    tree["bufferViews"][0]["byteLength"] = tree["buffers"][0]["byteLength"] = 12 * count
    (tmp_path / "many.glb").write_bytes(glb(tree, bytes(12 * count)))
    most = LIMITS["triangles of a mesh"].most
    with pytest.raises(MeshError, match=rf"10001000 triangles; the maximum is {most}"):
        read_surfaces(tmp_path / "many.glb")


def test_a_mirror_leaves_the_outside_outside_and_normals_upright(tmp_path: Path) -> None:
    """As a plane's normal goes along with its points, whatever stretches them."""
    tree = changed("nodes", 0, "scale", to=[-1.0, 2.0, 5.0])
    tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 1
    tree["accessors"].append(dict(tree["accessors"][0], byteOffset=36))
    tree["bufferViews"][0]["byteLength"] = tree["buffers"][0]["byteLength"] = 72
    (tmp_path / "mirror.glb").write_bytes(glb(tree, NUMBERS + np.ones((3, 3), "<f4").tobytes()))
    [surface] = read_surfaces(tmp_path / "mirror.glb")
    a, b, c = surface.points[surface.faces[0]]
    across = np.cross(b - a, c - a)
    for normal in surface.normals:
        np.testing.assert_allclose(
            normal / np.linalg.norm(normal), across / np.linalg.norm(across), atol=1e-12
        )
    assert across @ (a + b + c) > 0.0


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), mode=st.sampled_from([4, 5, 6]), count=st.integers(3, 30))
def test_strips_and_fans_are_the_triangles_that_their_corners_say(
    tmp_path_factory: pytest.TempPathFactory, seed: int, mode: int, count: int
) -> None:
    count -= count % 3 if mode == 4 else 0
    points = np.random.default_rng(seed).uniform(-1, 1, (count, 3)).astype("<f4")
    tree = changed("accessors", 0, "count", to=count)
    tree["bufferViews"][0]["byteLength"] = tree["buffers"][0]["byteLength"] = 12 * count
    uri = "data:application/octet-stream;base64," + base64.b64encode(points.tobytes()).decode()
    tree["buffers"][0]["uri"] = uri
    tree["meshes"][0]["primitives"][0]["mode"] = mode
    path = tmp_path_factory.getbasetemp() / "drawn.gltf"
    path.write_text(json.dumps(tree))
    expected = {
        4: [(3 * n, 3 * n + 1, 3 * n + 2) for n in range(count // 3)],
        5: [(n, n + 1, n + 2) if n % 2 == 0 else (n + 1, n, n + 2) for n in range(count - 2)],
        6: [(0, n + 1, n + 2) for n in range(count - 2)],
    }[mode]
    [surface] = read_surfaces(path)
    np.testing.assert_array_equal(surface.points[surface.faces], points[np.array(expected)])


def test_a_polygon_is_a_fan_and_corners_need_not_name_normals(tmp_path: Path) -> None:
    path = tmp_path / "square.obj"
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\n"
    path.write_text(square + "f 1//1 2//1 \\\n 3//1 4//-1 # a square\n")
    [surface] = read_surfaces(path)
    assert surface.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    np.testing.assert_array_equal(surface.normals, [[0, 0, 1]] * 4)
    path.write_text(square + "f 1//1 2//1 3//1\nf 1 3 4\n")
    [surface] = read_surfaces(path)
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
        read_surfaces(path)


def test_the_corpus_is_whole() -> None:
    for name in ("stl", "obj", "glb", "gltf"):
        assert list((CORPUS / name).iterdir())
