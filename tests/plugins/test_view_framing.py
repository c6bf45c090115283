"""Cameras that are framed on a study's targets hold them, and the tip on its way, in sight."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from rehearsal import loaded
from windows import MACHINE, a_view, projected

from labcrane import ProtocolError, Run
from labcrane.machines import link_frames, reach
from labcrane.protocol.rig import Rig
from labcrane_view.framing import framed, must_be_seen
from labcrane_view.settings import CAMERAS, CameraSettings

STUDIES = ("aiming", "crane_pilot")
SIZES = ((1280, 720), (1920, 1200), (1024, 768), (3860, 1080))


@pytest.fixture(scope="module", params=STUDIES)
def run(request: pytest.FixtureRequest) -> Run:
    study = loaded(Path(__file__).parents[2] / "protocols" / request.param / "protocol.yaml")
    return Rig.build(study, simulated=True).describe(study, participant_seed=0)


def on_the_way(run: Run) -> np.ndarray:
    """Return the tip's places between the circles of all pairs when the joints move together."""
    tips = []
    for one, other in pairwise([run.places[-1], *run.places]):
        start, end = (np.array(reach(run.machine, each.centre)) for each in (one, other))
        ways = (start + share * (end - start) for share in np.linspace(0.0, 1.0, 21))
        tips += [link_frames(run.machine, angles.tolist())[-1][:3, 3] for angles in ways]
    return np.array(tips)


@pytest.mark.parametrize("size", SIZES)
def test_all_pairs_and_the_tip_between_them_are_in_the_picture(
    run: Run, size: tuple[int, int]
) -> None:
    assert len(run.places) == 16
    eye = CAMERAS["cab"].eye
    look, fov_deg = framed("cab", np.array(eye), must_be_seen(run), size[0] / size[1])
    camera = CameraSettings(eye=eye, look=tuple(look.tolist()), fov_deg=fov_deg)
    rest = link_frames(run.machine, run.machine.rest)[-1][:3, 3]
    for place in run.places:
        x, y = projected(place.centre, camera, size)
        away = math.dist(place.centre, eye)
        radius = 1.1 * size[0] / 2 / math.tan(math.radians(fov_deg / 2)) * place.radius / away
        assert radius < x < size[0] - radius, place.name
        assert radius < y < size[1] - radius, place.name
    pixels = np.array([projected(tuple(tip), camera, size) for tip in [rest, *on_the_way(run)]])
    assert (pixels > 0.0).all()
    assert (pixels < size).all()
    # The picture is no wider than it must be: something nearly touches an edge.
    must = np.array([projected(tuple(p), camera, size) for p in must_be_seen(run)])
    edges = np.minimum(must.min(axis=0), np.array(size) - must.max(axis=0)) / size
    assert edges.min() < 0.04


def test_a_camera_that_cannot_hold_the_targets_is_refused() -> None:
    with (
        pytest.raises(
            ProtocolError, match=r"^camera 'cab' looks at the targets, and no task of this study"
        ),
        a_view(camera="cab", renderer="software"),
    ):
        pass
    around = 3.0 * np.array([[1.0, 0.0, 0.0], [-1.0, 0.1, 0.0], [0.0, 1.0, 0.0]])
    with pytest.raises(ProtocolError, match=r"^camera 'c' at \(0, 0, 0\) m is too close to the"):
        framed("c", np.zeros(3), around, 1.5)
    with pytest.raises(ValidationError, match="attached to 'wrist' cannot keep the targets in its"):
        CameraSettings(eye=(0, 0, 0), look="targets", on=MACHINE.names[-1])
