"""What a crane looks like: cylinders fixed at both ends; and what tells how high its tip is."""

import numpy as np
import pytest
from windows import MACHINE, POSE, a_scene, a_view, make_frame, projected

from labcrane.machines import link_frames
from labcrane.testing import crane_at
from labcrane_view.scene.rams import hoses, rams
from labcrane_view.settings import CAMERAS

CUES = ("tip_shadow", "plumb_line", "ground_grid")


@pytest.mark.parametrize("seed", range(5))
def test_a_cylinder_turns_with_both_links_and_its_rod_reaches_out_of_the_barrel(seed: int) -> None:
    random = np.random.default_rng(seed)
    found = list(rams(MACHINE, a_scene().bodies))
    assert [ram.name for ram in found] == ["shoulder", "elbow", "wrist"]
    for _ in range(20):
        # Where an operator works: a boom that lies on its column hides its cylinder.
        shares = random.uniform(0.25, 0.75, 4)
        limits = np.array(MACHINE.limits)
        poses = link_frames(MACHINE, (limits[:, 0] + shares * np.ptp(limits, axis=1)).tolist())
        for ram in found:
            foot, eye = ram.ends(poses)
            for end, frame, point in (
                (foot, ram.frames[0], ram.foot),
                (eye, ram.frames[1], ram.eye),
            ):
                back = poses[frame][:3, :3].T @ (end - poses[frame][:3, 3])
                np.testing.assert_allclose(back, point, atol=1e-9)
            assert np.linalg.norm(eye - foot) > 0.5 * ram.barrel


def test_a_machine_with_meshes_of_its_own_gets_no_cylinders_that_do_not_belong_to_it() -> None:
    bodies = a_scene().bodies
    assert list(rams(MACHINE, bodies[:2])) == []
    assert hoses(bodies[0]) is None
    assert hoses(bodies[-1]) is not None


@pytest.mark.slow
@pytest.mark.parametrize("renderer", ["auto", "software"])
def test_depth_cues_stand_below_the_tip_on_the_ground(renderer: str) -> None:
    frame = make_frame()
    frame.state = crane_at(MACHINE, POSE)
    x, y, z = link_frames(MACHINE, POSE)[-1][:3, 3].tolist()
    assert z > 1.0
    pictures = {}
    for cues in ((), *((cue,) for cue in CUES)):
        with a_view(
            renderer=renderer, camera="free", targets=False, shadow=0, depth_cues=cues
        ) as view:
            view.present(frame)
            view.present(frame)
            pictures[cues] = view.picture().astype(int)
    camera = CAMERAS["free"]
    changed = {cue: (np.abs(pictures[(cue,)] - pictures[()]).max(axis=-1) > 12) for cue in CUES}
    rows, columns = np.nonzero(changed["tip_shadow"])
    middle = (columns.mean() + 0.5, rows.mean() + 0.5)
    assert middle == pytest.approx(projected((x, y, 0.01), camera), abs=2.0)
    rows, columns = np.nonzero(changed["plumb_line"])
    foot, top = projected((x, y, 0.0), camera), projected((x, y, z), camera)
    assert rows.max() + 1 == pytest.approx(foot[1], abs=2.0)
    assert rows.min() >= top[1] - 2.0
    assert abs(columns.mean() + 0.5 - foot[0]) < 3.0
    # Lines a metre apart: one crosses each of these points of the ground.
    for at in ((5.0, 2.0), (4.0, -3.0), (6.0, 0.0)):
        column, row = (round(each) for each in projected((*at, 0.0), camera))
        assert changed["ground_grid"][row - 2 : row + 3, column - 2 : column + 3].any(), at
