"""The examples, installed as those of somebody else would be, pass their tests and run."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from fresh_environment import environment_with, run

from labcrane import open_recording
from labcrane.recording import SessionRecord

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = sorted(path.parent.name for path in EXAMPLES.glob("*/pyproject.toml"))

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def projects(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("examples")
    return {name: shutil.copytree(EXAMPLES / name, folder / name) for name in NAMES}


@pytest.fixture(scope="module")
def environment(projects: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return environment_with(projects.values(), tmp_path_factory.mktemp("environment"))


@pytest.mark.parametrize("name", NAMES)
def test_its_tests_pass(name: str, environment: Path, projects: dict[str, Path]) -> None:
    done = run(environment, "-m", "pytest", "-q", "-p", "no:cacheprovider", cwd=projects[name])
    assert done.returncode == 0, done.stdout
    assert " passed" in done.stdout


def simulate(environment: Path, protocol: Path, data: Path, how: str) -> SessionRecord:
    arguments = ["--participant", "P001", "--simulate", how, "--data", data]
    done = run(environment, "-m", "labcrane", "run", protocol, *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    return open_recording(data / "P001-SIMULATED" / "P001-SIMULATED.h5").session(1)


def test_the_lamp_is_told_over_its_line_what_the_record_says(
    environment: Path,
    projects: dict[str, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(projects["lamp"])
    from device import LampDevice

    device = LampDevice()
    protocol = projects["lamp"] / "protocol.yaml"
    protocol.write_text(
        protocol.read_text(encoding="utf-8").replace("/dev/ttyUSB0", device.port), encoding="utf-8"
    )
    session = simulate(environment, protocol, tmp_path, "--feedback")
    shown = session.streams["labcrane.feedback.lamp"].data
    assert len(shown), session.events["data"].tolist()
    light = np.round(255 * shown["light"].to_numpy())
    assert light.max() > 200, "the tip has come to the target"
    assert set(light) <= set(device.light)
    assert device.light[-1] == device.motor[-1] == 0


def test_the_second_task_is_recorded_in_its_block_alone(
    environment: Path, projects: dict[str, Path], tmp_path: Path
) -> None:
    session = simulate(environment, projects["nback"] / "protocol.yaml", tmp_path, "--fast")
    balls = session.events.query("name == 'nback.ball'")
    assert len(balls) >= 2
    trials = session.trials.set_index("condition")
    given = {data["trial"] for data in balls["data"]}
    assert given >= set(trials.loc["two tasks", "trial"])
    assert not given & set(trials.loc["one task", "trial"])
    assert trials.loc["two tasks", "nback_hit_share"].dropna().eq(0.0).all()  # it never presses
    assert trials.loc["one task", "nback_hit_share"].isna().all()


def test_sql_finds_what_was_recorded(
    environment: Path, projects: dict[str, Path], tmp_path: Path
) -> None:
    protocol = projects["sqlite"] / "protocol.yaml"
    session = simulate(environment, protocol, tmp_path / "data", "--fast")
    out = tmp_path / "database"
    to = ["--to", "sqlite", "--include", "simulated", "--out", out]
    done = run(environment, "-m", "labcrane", "export", tmp_path / "data", *to)
    assert done.returncode == 0, done.stderr
    with closing(sqlite3.connect(out / "study.db")) as database:
        found = database.execute("select movement_time from trial order by trial").fetchall()
    np.testing.assert_allclose(np.ravel(found), session.trials["movement_time"])
