"""A session with a sphere and a vibration, killed in the middle, resumed, exported and reported.

The tactors are our own sketch at the other end of a serial line.
"""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from faults.sessions import finished, kill_all, labcrane, unique, wait_for
from needs import needs
from simple_crane import FORM
from tactor_board import Board, serial_board

from labcrane import open_recording

STUDY = (
    """\
labcrane: 1
study: {study}
title: A study with a vibration
rate_hz: 240
"""
    + FORM
    + """\
tasks:
  aiming: {{use: aiming, distances: [2], movements: 2, limit_s: 1.5}}
feedback:
  ball: {{use: sphere, far: 4.0}}
  pulse: {{use: vibration, port: {port}, tactors: {{left: 90, right: -90}}, pulse_hz: null,
    far: 4.0, aside: 2.0, amplitude: [0.2, 0.8], silent_after_s: null}}
design:
  conditions: {{sphere: [ball], touch: [pulse]}}
  order: {{condition: latin_square}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming, condition: 1, pairs: 2}}
      - block: {{task: aiming, condition: 2, pairs: 2}}
on_fault: {{session_died: redo_trial}}
"""
)

STOPS_S = 0.2
"""How long the board goes on by itself."""

LATE_S = 0.05
"""How late a board on a busy computer may notice it."""


@dataclass
class Done:
    """A session that was killed and resumed."""

    data: Path
    board: Board
    stopped_s: float


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Done:
    folder = tmp_path_factory.mktemp("vibration")
    data, protocol = folder / "data", folder / "study.yaml"
    options = ("--participant", "P001", "--simulate", "--feedback", "--no-page", "--data", data)
    with serial_board(folder) as board:
        protocol.write_text(STUDY.format(study=unique("vibration"), port=board.address))
        run = labcrane("run", protocol, *options)
        wait_for(lambda: run.poll() is not None or board.vibrates())
        assert run.poll() is None, run.communicate()[0]
        kill_all(run)
        killed = time.monotonic()
        wait_for(lambda: not board.vibrates())
        last = board.changes()[-1][0]
        finished(labcrane("resume", protocol, *options))
        return Done(data, board, last - killed)


@needs("g++")
@pytest.mark.slow
def test_the_tactors_stop_within_a_moment_of_a_kill(done: Done) -> None:
    assert done.stopped_s < STOPS_S + LATE_S
    assert not done.board.vibrates(), "the session is over"


@needs("g++")
@pytest.mark.slow
def test_what_was_felt_can_be_computed_from_the_record(done: Done) -> None:
    folder = done.data / "P001-SIMULATED"
    session = open_recording(folder / "P001-SIMULATED.h5").session(1)
    presented = session.streams["labcrane.feedback.pulse"].data
    ticks = session.streams["loop"].data["tick"].to_numpy()
    begins = np.flatnonzero(ticks == 0.0)
    assert len(begins) == 2  # of the run that was killed, and of the one that resumed
    felt = presented[presented["vibration.amplitude"] > 0.0]
    assert len(felt) > 200
    due = session.streams["state"].time
    at = np.searchsorted(due, felt["frame.due"].to_numpy() - 1e-6)
    state, task = (session.streams[name].data.iloc[at] for name in ("state", "task"))
    way = np.stack(
        [
            task[f"target.position.{axis}"].to_numpy() - state[f"tip.position.{axis}"].to_numpy()
            for axis in "xyz"
        ]
    )
    near = 1.0 - np.minimum(np.linalg.norm(way, axis=0) / 4.0, 1.0)
    np.testing.assert_allclose(felt["vibration.amplitude"], 0.2 + 0.6 * near, atol=1e-9)
    left = 0.5 + 0.5 * way[1] / np.maximum(np.hypot(way[0], way[1]), 2.0)
    wanted = (0.2 + 0.6 * near) * left
    # A level that changed less than 10 ms ago is told with the next frame.
    told = felt["vibration.level.left"].to_numpy()
    assert np.mean(np.abs(told - wanted) < 0.02) > 0.95


@needs("g++")
@pytest.mark.slow
def test_commands_are_answered_and_the_answers_recorded(done: Done) -> None:
    folder = done.data / "P001-SIMULATED"
    session = open_recording(folder / "P001-SIMULATED.h5").session(1)
    answers = session.streams["labcrane.feedback.pulse.answer"].data
    sent = session.streams["labcrane.feedback.pulse"].data["vibration.command"]
    assert len(answers) > 0.9 * sent.nunique()
    assert (answers["delay"] > 0.0).all()
    assert answers["delay"].median() < 0.02


@needs("g++")
@pytest.mark.slow
def test_the_session_is_exported_and_reported(done: Done, tmp_path: Path) -> None:
    for words in (
        ("export", done.data, "--include", "simulated", "--to", "tables", "--out", tmp_path / "t"),
        ("report", done.data, "--include", "simulated", "--out", tmp_path / "r"),
    ):
        finished(labcrane(*words))
    (trials,) = (tmp_path / "t").rglob("trials.csv")
    table = pd.read_csv(trials)
    given = set(zip(table["condition"], table["feedback"], strict=True))
    assert given == {("sphere", "ball"), ("touch", "pulse")}
    report = "".join(path.read_text() for path in (tmp_path / "r").rglob("*.html"))
    assert "labcrane.feedback.pulse" in report
