"""Meshes and scenes in the view: read alike from every format, drawn where they are."""

import struct
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from needs import GRAPHICS, needs
from rehearsal import SHORT, a_study
from windows import MACHINE, POSE, make_frame, projected

from labcrane import DeviceError, Machine, ProtocolError
from labcrane.approval.materials import referred
from labcrane.machines import MeshFile, link_boxes, link_frames, urdf_of
from labcrane.recording.run_codec import read_run, write_run
from labcrane.testing import TARGETS, make_run
from labcrane_view.scene.mesh_reader import read_mesh
from labcrane_view.settings import ViewSettings
from labcrane_view.view import View

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
"""A pyramid with different edges along x, y and z."""


def stl() -> bytes:
    rows = [struct.pack("<12fH", 0, 0, 0, *POINTS[face].ravel(), 0) for face in FACES]
    return bytes(80) + struct.pack("<I", len(rows)) + b"".join(rows)


def ascii_stl() -> bytes:
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {:g} {:g} {:g}\n".format(*POINTS[corner]) for corner in face)
        + "endloop\nendfacet\n"
        for face in FACES
    )
    return f"solid pyramid\n{facets}endsolid pyramid\n".encode()


def obj() -> bytes:
    points = "".join("v {:g} {:g} {:g}\n".format(*point) for point in POINTS)
    return (points + "".join("f {} {} {}\n".format(*(face + 1)) for face in FACES)).encode()


KINDS = {"a.stl": stl, "b.stl": ascii_stl, "c.obj": obj}


def written(folder: Path, name: str) -> Path:
    path = folder / name
    path.write_bytes(KINDS[name]())
    return path


@pytest.mark.parametrize("name", KINDS)
def test_a_mesh_is_the_same_in_every_format(name: str, tmp_path: Path) -> None:
    mesh = read_mesh(MeshFile(file=written(tmp_path, name)))
    corners = mesh.points[mesh.faces]
    found = sorted(sorted(map(tuple, triangle)) for triangle in corners.round(6).tolist())
    assert found == sorted(sorted(map(tuple, POINTS[face].tolist())) for face in FACES)
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((corners.mean(axis=1) - POINTS.mean(axis=0)) * outward).sum(axis=1).min() > 0
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-6)


@pytest.mark.parametrize("broken", ["v 1e999 0 0", "vn 0 1e9990 1"])
def test_a_mesh_with_what_is_no_number_is_refused_in_words(broken: str, tmp_path: Path) -> None:
    path = tmp_path / "broken.obj"
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    more = "v 0 0 1\n" if broken.startswith("vn") else "vn 0 0 1\n"
    path.write_text(f"{corners}{more}{broken}\nf 1//1 2//1 3//1\nf 1//1 2//1 4//1\n")
    with pytest.raises(ValueError, match=r"broken\.obj' has points or normals that are not finite"):
        MeshFile(file=path)


def test_a_mesh_is_scaled_turned_and_put_in_its_place(tmp_path: Path) -> None:
    asked = MeshFile(
        file=written(tmp_path, "a.stl"), scale=0.1, turn_deg=(90, 0, 90), position=(1, 2, 3)
    )
    # About x, the pyramid's y goes to z and its z to -y; then about z, x to y and -y to x.
    points = read_mesh(asked).points
    np.testing.assert_allclose(points.min(axis=0), [1.0, 2.0, 3.0], atol=1e-6)
    np.testing.assert_allclose(points.max(axis=0), [1.3, 2.1, 3.2], atol=1e-6)


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        (
            "a.stl",
            b"nonsense" * 20,
            r"^mesh '.*a\.stl' states that it has \d+ triangles but has room",
        ),
        ("c.obj", b"v 0 0 0\nv 1 0 0\nl 1 2\n" * 20, r"^mesh '.*c\.obj' holds no triangles"),
    ],
    ids=["stl", "obj"],
)
def test_a_mesh_that_is_damaged_after_it_was_checked_is_named_by_the_view(
    name: str, content: bytes, why: str, tmp_path: Path
) -> None:
    asked = MeshFile(file=written(tmp_path, name))
    asked.file.write_bytes(content)
    with pytest.raises(DeviceError, match=why):
        read_mesh(asked)


CRANE = Path(__file__).parents[2] / "labcrane" / "machines" / "data" / "ch8.yaml"


def a_machine_study(folder: Path, mesh: str) -> Path:
    """Write a study whose machine, in a folder of its own, has a mesh on its last link."""
    (folder / "cranes").mkdir(exist_ok=True)
    lines = CRANE.read_text(encoding="utf-8").rstrip().splitlines()
    assert "name: wrist" in lines[-1]
    lines[-1] = lines[-1].rstrip("}") + f", mesh: {mesh}}}"
    (folder / "cranes" / "mine.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    text = SHORT.replace("machine: ch8", "machine: cranes/mine.yaml")
    return a_study(folder, text).path


@pytest.mark.parametrize(
    ("mesh", "why"),
    [
        (
            "no.stl",
            r"mine\.yaml:\d+:\d+: joints\[4\]\.mesh.*there is no mesh '.*no\.stl'; paths",
        ),
        (
            "cut.stl",
            r"mine\.yaml:\d+:\d+: .*cut\.stl' states that it has 4 triangles but has room for 3.96",
        ),
        ("arm.step", r"'.*arm\.step' is not a mesh file; use \.stl, \.obj"),
        ("{file: a.stl, scale: -1}", r"mesh\.scale is -1; it must be greater than 0"),
    ],
)
def test_a_protocol_with_a_wrong_mesh_is_refused(mesh: str, why: str, tmp_path: Path) -> None:
    (tmp_path / "cranes").mkdir()
    written(tmp_path / "cranes", "a.stl")
    (tmp_path / "cranes" / "cut.stl").write_bytes(stl()[:-2])
    with pytest.raises(ProtocolError, match=why):
        a_machine_study(tmp_path, mesh)


def test_meshes_are_part_of_what_is_approved(tmp_path: Path) -> None:
    (tmp_path / "cranes").mkdir()
    written(tmp_path / "cranes", "a.stl")
    protocol = a_machine_study(tmp_path, "{file: a.stl, scale: 0.5}")
    named = referred({"machine": "cranes/mine.yaml"}, protocol.parent)
    assert {path.name for path in named} == {"mine.yaml", "a.stl"}


def meshed(folder: Path, **settings: object) -> Machine:
    """Return the crane with a pyramid instead of its last link."""
    mesh = MeshFile(file=written(folder, "a.stl"), colour=(1.0, 0.0, 1.0), **settings)
    joints = (*MACHINE.joints[:-1], MACHINE.joints[-1].model_copy(update={"mesh": mesh}))
    return Machine.model_validate({**MACHINE.model_dump(), "joints": joints})


def test_a_mesh_changes_nothing_that_is_touched_and_is_sent_along(tmp_path: Path) -> None:
    machine = meshed(tmp_path)
    assert urdf_of(machine) == urdf_of(MACHINE)
    run = replace(make_run(machine, task=TARGETS), bodies=link_boxes(machine))
    again = read_run(write_run(run))
    assert again.bodies == run.bodies
    assert again.machine == machine


def spots(picture: np.ndarray) -> np.ndarray:
    """Return where it is magenta, in the sun or in the shade."""
    red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
    return (red > 60) & (blue > 60) & (green < 0.4 * red)


@needs(*GRAPHICS)
def test_a_link_is_drawn_as_its_mesh(tmp_path: Path) -> None:
    machine = meshed(tmp_path, scale=0.3, position=(-0.5, 0.0, 0.0))
    run = replace(make_run(machine, task=TARGETS), bodies=link_boxes(machine))
    view = View(ViewSettings(display="hidden", size=(640, 360), camera="free", hud=()), machine)
    view.open(run)
    with closing(view):
        view.present(make_frame())
        view.present(make_frame())
        rows, columns = np.nonzero(spots(view.picture()))
    link = link_frames(machine, POSE)[len(machine.joints)]
    corners = (0.3 * POINTS + [-0.5, 0.0, 0.0]) @ link[:3, :3].T + link[:3, 3]
    camera = ViewSettings(camera="free").camera
    x, y = np.array([projected(tuple(corner), camera) for corner in corners]).T
    edges = (columns.min(), columns.max() + 1, rows.min(), rows.max() + 1)
    np.testing.assert_allclose(edges, (x.min(), x.max(), y.min(), y.max()), atol=2.0)


SCENE = """\
labcrane_scene: 1
title: a crate behind a wall
things:
  crate:
    {shape: sphere, size: [0.4, 0.4, 0.4], position: [5, 0, 1], mesh: {file: a.stl, scale: 0.2}}
  wall: {shape: box, size: [0.2, 1.5, 0.8], position: [6, 1, 0.4], yaw_deg: 30, fixed: true}
  post: {shape: cylinder, size: [0.3, 0.3, 1.2], position: [4.5, 1.5, 0.6], fixed: true}
figure: {position: [4.0, -1.2, 0.13], yaw_deg: 40}
goals: [{position: [5, 0, 1], radius: 0.2}]
"""
CAMERA = {"name": "c", "eye": (0.5, 0.0, 2.5), "look": (5.0, 0.0, 0.5)}
