"""Meshes that are touched: solids without hollows, of which a thing with hollows is made."""

import itertools
import math
import re
from pathlib import Path

import numpy as np
import pytest
from cranes import needs_bullet
from dmd_arms import RETRIEVAL, standing, step
from scipy.spatial import ConvexHull

from labcrane import ProtocolError
from labcrane.machines import MeshFile, load_machine, load_part, reach, read_solids
from labcrane.protocol.referenced_files import named_files
from labcrane_dmd.arm.settings import ArmSettings

SIDE, FAR = ((-0.6, 0.0, 0.0), (0.15, 0.15, 0.6)), ((0.0, -0.7, 0.0), (0.15, 0.15, 0.6))
"""Two slabs that make an L with its inner corner at the origin: opposite corners, in metres."""

HEAD = "labcrane_part: 1\ntitle: a corner\nfixed: true\nlimit_n: 100\nshapes:\n"
SCENE = """\
labcrane_scene: 1
title: a corner
things: {{wall: {{use: wall.yaml, position: [{x}, {y}, 0], yaw_deg: {yaw}}}}}
goals: [{{position: [30, 0, 0], radius: 0.1}}]
"""
FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))


def corners(slab) -> np.ndarray:
    low, high = slab
    return np.array(list(itertools.product(*zip(low, high, strict=True))))


def obj(slabs, unit: float, move=lambda points: points) -> str:
    """Return boxes as an OBJ file whose unit is so many metres."""
    lines = []
    for number, slab in enumerate(slabs):
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in (move(corners(slab)) / unit).tolist()]
        lines += ["f " + " ".join(str(8 * number + at + 1) for at in face) for face in FACES]
    return "\n".join(lines) + "\n"


def box(slab) -> str:
    low, high = map(np.array, slab)
    return f"shape: box, size: {(high - low).tolist()}, centre: {((high + low) / 2).tolist()}"


def write(folder: Path, kind: str, unit: float = 0.001) -> None:
    """Write the corner as a mesh, as two boxes, or as the solid around it."""
    (folder / "wall.obj").write_text(obj((SIDE, FAR), unit), encoding="utf-8")
    around = np.vstack([corners(SIDE), corners(FAR)])
    around = around[ConvexHull(around).vertices] - [0.0, 0.0, 0.3]
    shapes = {
        "mesh": "  wall: {shape: mesh, centre: [0, 0, 0], mesh: {file: wall.obj, "
        f"scale: {unit}}}}}",
        "boxes": f"  side: {{{box(SIDE)}}}\n  far: {{{box(FAR)}}}",
        "hull": f"  wall: {{shape: hull, centre: [0, 0, 0.3], points: {around.tolist()}}}",
    }
    (folder / "wall.yaml").write_text(HEAD + shapes[kind] + "\n", encoding="utf-8")


@pytest.mark.parametrize("seed", range(5))
def test_a_meshs_solids_are_in_metres_where_its_file_puts_them(seed: int, tmp_path: Path) -> None:
    draw = np.random.default_rng(seed)
    unit = float(10.0 ** draw.uniform(-3, 0.5))
    shift = draw.uniform(-2.0, 2.0, 3)
    (tmp_path / "wall.obj").write_text(obj((SIDE, FAR), unit), encoding="utf-8")
    asked = MeshFile.model_validate(
        {"file": tmp_path / "wall.obj", "scale": unit, "position": shift, "turn_deg": (0, 0, 90)}
    )
    found = read_solids(asked)
    assert len(found) == 2
    for solid, slab in zip(found, (SIDE, FAR), strict=True):
        x, y, z = corners(slab).T
        wanted = np.stack([-y, x, z], axis=1) + shift
        np.testing.assert_allclose(np.sort(solid, axis=0), np.sort(wanted, axis=0), atol=1e-9)
        assert ConvexHull(solid).volume == pytest.approx(ConvexHull(wanted).volume, rel=1e-9)


def test_what_is_drawn_and_touched_of_a_turned_part_is_in_the_same_place(tmp_path: Path) -> None:
    write(tmp_path, "mesh")
    text = (tmp_path / "wall.yaml").read_text(encoding="utf-8")
    turned = text.replace("centre: [0, 0, 0]", "centre: [0.4, -0.3, 0], yaw_deg: 70")
    (tmp_path / "wall.yaml").write_text(turned, encoding="utf-8")
    geoms = load_part(tmp_path / "wall.yaml").geoms()
    cos, sin = math.cos(math.radians(70.0)), math.sin(math.radians(70.0))
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    for geom, slab in zip(geoms, (SIDE, FAR), strict=True):
        touched = np.array(geom.points) @ turn.T + geom.centre
        wanted = corners(slab) @ turn.T + [0.4, -0.3, 0.0]
        np.testing.assert_allclose(np.sort(touched, axis=0), np.sort(wanted, axis=0), atol=1e-9)
    first, second = geoms
    assert first.mesh is not None  # which shows both
    assert (first.drawn, second.drawn, second.mesh) == (True, False, None)
    origin = turn @ np.array(first.mesh.position) + first.centre
    np.testing.assert_allclose(origin, [0.4, -0.3, 0.0], atol=1e-9)


@pytest.mark.slow
@needs_bullet
@pytest.mark.parametrize("seed", range(3))
def test_a_hollow_is_entered_and_felt_at_its_true_surface_and_not_at_the_solid_around_it(
    seed: int, tmp_path: Path
) -> None:
    draw = np.random.default_rng([seed, 20])
    where = {"x": draw.uniform(1.76, 1.82), "y": draw.uniform(0.3, 0.5), "yaw": draw.uniform(-8, 8)}
    found = reach(load_machine("ied_arm.yaml", RETRIEVAL), (1.6, 0.0, 0.3))
    assert found is not None
    contact = {}
    for kind in ("mesh", "boxes", "hull"):
        write(tmp_path, kind)
        with standing(SCENE.format(**where), tmp_path) as (arm, state):
            arm.reset([math.radians(-60.0), *found[1:3], 0.0])
            seen = step(arm, 20.0, base=100.0)
            parts = [each for each in state.columns if each.startswith("scene.wall.force.")]
            force = seen[:, [state.index(each) for each in parts]].max(axis=1)
            first = int(np.argmax(force > 0.0))
            assert force[first] > 0.0, kind
            contact[kind] = math.degrees(seen[first, state.index("joint.angle.base")])
            assert parts == (
                ["scene.wall.force.side", "scene.wall.force.far"]
                if kind == "boxes"
                else ["scene.wall.force.wall"]  # its solids are one thing, with one limit
            )
    assert contact["mesh"] == pytest.approx(contact["boxes"], abs=0.1)
    assert contact["hull"] < contact["mesh"] - 8.0


OPEN = re.sub(r"(?m)^f 5 6 8 7\n", "", obj((SIDE,), 0.001))
L_OF_ONE_PIECE = """\
v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0
v 0 0 1\nv 2 0 1\nv 2 1 1\nv 1 1 1\nv 1 2 1\nv 0 2 1
f 4 3 2 1\nf 6 5 4 1\nf 7 8 9 10\nf 7 10 11 12
f 1 2 8 7\nf 2 3 9 8\nf 3 4 10 9\nf 4 5 11 10\nf 5 6 12 11\nf 6 1 7 12
"""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (OPEN, r"piece 1 of mesh '.*wall.obj' is open or has hollows: it has \d+ % of the volume"),
        (L_OF_ONE_PIECE, r"has 86 % of the volume of the solid around it; close it, or cut it"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "piece 1 of mesh .* is flat"),
        (obj((SIDE,) * 65, 0.001), "has 65 pieces, but contact allows 64 at most"),
    ],
)
def test_a_mesh_that_cannot_be_touched_as_it_is_seen_is_refused(
    text: str, message: str, tmp_path: Path
) -> None:
    write(tmp_path, "mesh")
    (tmp_path / "wall.obj").write_text(text, encoding="utf-8")
    with pytest.raises(ProtocolError, match=message):
        load_part(tmp_path / "wall.yaml")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((", mesh: {file: wall.obj, scale: 0.001}", ""), "has its file under mesh, and no size"),
        (("wall.obj", "wall.stl"), "'wall.stl' is not an OBJ file; a mesh for contact must be one"),
    ],
)
def test_a_mesh_that_is_touched_needs_an_obj_file(
    change: tuple[str, str], message: str, tmp_path: Path
) -> None:
    write(tmp_path, "mesh")
    (tmp_path / "wall.stl").write_text(
        "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
        "endloop\nendfacet\nendsolid a\n",
        encoding="utf-8",
    )
    path = tmp_path / "wall.yaml"
    path.write_text(path.read_text(encoding="utf-8").replace(*change), encoding="utf-8")
    with pytest.raises(ProtocolError, match=message):
        load_part(path)


def test_solids_that_were_cut_from_one_another_stay_two(tmp_path: Path) -> None:
    left, right = ((0, 0, 0), (1, 1, 1)), ((1, 0, 0), (2, 1, 1))
    (tmp_path / "cut.obj").write_text(obj((left, right), 1.0), encoding="utf-8")
    found = read_solids(MeshFile.model_validate({"file": tmp_path / "cut.obj"}))
    assert [sorted({x for x, _, _ in each.tolist()}) for each in found] == [[0, 1], [1, 2]]


def test_the_wall_of_the_library_is_in_a_scene_and_in_its_record() -> None:
    scene = RETRIEVAL / "scenes" / "reach_over.yaml"
    settings = ArmSettings.model_validate(
        {"model": RETRIEVAL / "arm.dmd.yaml", "proportional": ("base",), "scenes": (scene,)}
    )
    files = named_files([settings], RETRIEVAL)
    name = "scenes/parts/broken_wall.obj"
    assert files[name]["text"] == (RETRIEVAL / name).read_text(encoding="utf-8")
    geoms = load_part(RETRIEVAL / "scenes" / "parts" / "broken_wall.yaml").geoms()
    assert len(geoms) == 2
    assert 0.3 < max(geom.size[2] for geom in geoms) < 0.4  # metres
