"""Engines under a whole cohort: the same people do the same study on PyBullet and on MuJoCo."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from needs import needs

from labcrane import FloatArray, open_recording
from labcrane.files.pseudonyms import pseudonyms
from labcrane.recording import Recording, SessionRecord
from labcrane.simulation.simulation import SimulationJob, simulate_study

STUDY = Path(__file__).parents[2] / "protocols" / "crane_pilot"
APART_M = 1e-4
"""How far apart the tips of two engines may be at any tick."""


def simulated(folder: Path, engine: str, names: list[str]) -> list[Recording]:
    """Return the crane study of some people with an engine."""
    text = (STUDY / "protocol.yaml").read_text(encoding="utf-8")
    assert text.count("use: mujoco_crane") == 1
    protocol = folder / f"{engine}.yaml"
    protocol.write_text(text.replace("use: mujoco_crane", f"use: {engine}"), encoding="utf-8")
    (folder / "instructions.md").write_bytes((STUDY / "instructions.md").read_bytes())
    cohort = STUDY / "cohort.yaml"
    jobs = [SimulationJob(protocol, cohort, folder / f"{engine}-data", name) for name in names]
    made = {each.name: each for each in simulate_study(jobs, workers=2)}
    return [open_recording(made[job.folder.name].participant_file) for job in jobs]


def tip_of(session: SessionRecord) -> FloatArray:
    """Return where the tip was in each tick, shape ``(n, 3)``, in metres."""
    state = session.streams["state"]
    return np.column_stack([state.column(f"tip.position.{axis}") for axis in "xyz"])


def compared(folder: Path, names: list[str]) -> None:
    """Make sure that people do on one engine what they do on the other, tick by tick."""
    pairs = [simulated(folder, engine, names) for engine in ("bullet_crane", "mujoco_crane")]
    moved = 0.0
    for name, bullet, mujoco in zip(names, *pairs, strict=True):
        one, other = bullet.session(1), mujoco.session(1)
        assert len(one.trials) == 32, name
        told = ["trial", "pair", "distance", "outcome", "ticks", "started", "ended"]
        told = [name for name in told if name in one.trials]
        assert {"trial", "outcome", "started", "ended"} <= set(told)
        pd.testing.assert_frame_equal(one.trials[told], other.trials[told], rtol=0.0, atol=0.0)
        tips = [tip_of(each) for each in (one, other)]
        assert tips[0].shape == tips[1].shape
        assert np.linalg.norm(tips[0] - tips[1], axis=1).max() < APART_M, name
        moved += float(np.linalg.norm(np.diff(tips[0], axis=0), axis=1).sum())
    assert moved > 32 * 2.0 * len(names), "each movement is two metres at least"


@needs("pybullet")
@needs("mujoco")
@pytest.mark.parametrize(
    "people", [pytest.param(2, marks=pytest.mark.long), pytest.param(36, marks=pytest.mark.soak)]
)
def test_people_do_on_mujoco_what_they_do_on_pybullet(tmp_path: Path, people: int) -> None:
    drawn = np.random.default_rng().choice(pseudonyms(r"P\d{3}", 36), people, replace=False)
    compared(tmp_path, sorted(drawn.tolist()))
