"""A movement played in a real window, seen from outside: on the X server and on LSL."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pylsl
import pytest
from needs import GRAPHICS, needs
from programs import ran
from rehearsal import SHORT
from windows import an_x_server

from labcrane.streams.feedback_log import log_name
from labcrane.testing import main

STUDY = (
    SHORT
    + """
feedback:
  ball: {use: sphere}
  tone: {use: sonification, driver: jack}
views:
  VIEW: {use: view, size: [200, 120], shadow: 0, areas: [tip]}
"""
)


def a_protocol(folder: Path) -> tuple[Path, str]:
    view = f"window{os.getpid()}"
    path = folder / "study.yaml"
    path.write_text(STUDY.replace("VIEW", view), encoding="utf-8")
    return path, view


@pytest.mark.long
def test_a_movement_is_played_in_real_time_in_a_window(tmp_path: Path) -> None:
    protocol, view = a_protocol(tmp_path)
    with an_x_server() as display:
        environment = {**os.environ, "DISPLAY": display, "JACK_DEFAULT_SERVER": "nobody"}
        player = subprocess.Popen(
            [sys.executable, "-m", "labcrane", "feedback", "preview", str(protocol)],
            env=environment,
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
        )
        try:
            (info,) = pylsl.resolve_byprop("name", log_name(view), timeout=240.0)
            inlet = pylsl.StreamInlet(info)
            labels = inlet.info().get_channel_labels()
            rows: list[list[float]] = []
            while player.poll() is None:
                rows += inlet.pull_chunk(timeout=0.2)[0]
            said = player.communicate()[0]
        finally:
            player.kill()
            player.wait()
    assert player.returncode == 0, said
    assert "tone failed: the jack sound system does not take" in said
    assert "start a JACK server first; it is left out" in said
    assert not (tmp_path / "preview").exists()
    shown = dict(zip(labels, np.array(rows).T, strict=True))
    tick, flip = shown["shown.tick"], shown["flip.time"]
    assert (np.diff(tick) >= 0).all()
    moving = (tick > tick[0]) & (tick < tick[-1])
    assert moving.sum() > 20
    speed = np.polyfit(flip[moving], tick[moving], 1)[0]
    assert speed == pytest.approx(240.0, rel=0.02)  # as many ticks a second as in the session
    assert np.isfinite(shown["cue.ball.radius"][moving]).all()


@pytest.mark.slow
@needs(*GRAPHICS)
def test_without_a_display_it_is_written_to_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    protocol, view = a_protocol(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.chdir(tmp_path)
    assert main(["feedback", "preview", str(protocol)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("there is no display (DISPLAY is not set); files go to preview/")
    names = {path.name for path in (tmp_path / "preview").iterdir()}
    assert f"{view}-000.png" in names
    assert "tone.wav" in names


@pytest.mark.slow
def test_where_nothing_can_be_shown_it_says_so(tmp_path: Path) -> None:
    protocol, _ = a_protocol(tmp_path)
    done = ran(
        [sys.executable, "-m", "labcrane", "feedback", "preview", str(protocol)],
        env={"DISPLAY": ":4711", "JACK_DEFAULT_SERVER": "nobody"},
    )
    assert done.returncode == 1
    assert "nothing can draw here: neither OpenGL nor the software renderer" in done.stdout
    assert "nothing can be shown or sounded here; --out FOLDER writes files instead" in done.stderr
