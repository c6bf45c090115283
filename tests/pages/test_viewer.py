"""The viewer: poses, curves and events are those of the record; its page shows them."""

import random
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from faults.sessions import unique, wait_for
from pages.looks import check
from pages.room import shown, text
from selenium import webdriver
from selenium.webdriver.common.by import By
from simple_crane import FORM

from labcrane import open_recording
from labcrane.cli.app import main
from labcrane.errors import RecordingError
from labcrane.machines.kinematics import link_frames
from labcrane.registry.registry import discover
from labcrane.web.room.shown import ShownShapes
from labcrane.web.viewer.film import POINTS, STEPS, WINDOW_SAMPLES, Film
from labcrane.web.viewer.opened import opened

STUDY = (
    "labcrane: 1\nstudy: {study}\ntitle: Viewed\nrate_hz: 240\n"
    + FORM.replace("dual_joystick", "simulated_operator")
    + "feedback:\n  ball: {{use: sphere, at: target, far: 4.0}}\n"
    "tasks:\n  aiming: {{use: aiming, distances: [3], movements: 2, limit_s: 20}}\n"
    "sessions:\n  - name: only\n    steps:\n"
    "      - block: {{task: aiming, pairs: 1, feedback: [ball]}}\n"
)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("viewed")
    protocol = folder / "study.yaml"
    protocol.write_text(STUDY.format(study=unique("viewed")))
    words = ["run", str(protocol), "--participant", "P001", "--simulate", "--fast"]
    assert main([*words, "--data", str(folder / "data")]) == 0
    return folder / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5"


@pytest.fixture(scope="module")
def film(file: Path) -> Film:
    return Film(open_recording(file).session(1), file.stem)


def moments(length: float, count: int = 100) -> list[float]:
    draw = random.Random(23)
    return [draw.uniform(0.0, length) for _ in range(count)]


def test_a_frame_of_a_film_is_the_newest_recorded_row_at_any_time(file: Path, film: Film) -> None:
    record = open_recording(file).session(1)
    time_s = record.streams["state"].time
    tables = {name: record.streams[name].data for name in ("state", "task", "input")}
    for at in moments(film.length):
        row = int(np.flatnonzero(time_s - time_s[0] <= at + 1e-9)[-1])
        frame = film.frame(at)
        for name, table in tables.items():
            begins = {"input": "axes."}.get(name, f"{name}.")
            found = [frame[begins + column] for column in table]
            np.testing.assert_array_equal(found, table.iloc[row].to_numpy(float))


def test_a_curve_has_the_lowest_and_highest_value_of_every_step(file: Path, film: Film) -> None:
    record = open_recording(file).session(1)
    state = record.streams["state"]
    time_s, values = state.time - state.time[0], state.data["joint.angle.slew"].to_numpy()
    draw = random.Random(5)
    for _ in range(5):
        begin, end = sorted(draw.uniform(0.0, film.length) for _ in range(2))
        found = film.curve("state", "joint.angle.slew", begin, end)
        edges = np.linspace(begin, end, POINTS + 1)
        for at in draw.sample(range(POINTS), 40):
            part = values[(time_s >= edges[at]) & (time_s < edges[at + 1])]
            expected = (part.min(), part.max()) if len(part) else (None, None)
            assert (found["low"][at], found["high"][at]) == expected


def test_trials_are_those_of_the_record_and_a_pause_in_the_frames_is_a_gap(
    file: Path, film: Film
) -> None:
    table = open_recording(file).session(1).trials
    counted = [trial for trial in film.trials if trial["counted"]]
    assert [trial["trial"] for trial in counted] == table["trial"].tolist()
    assert [trial["outcome"] for trial in counted] == table["outcome"].tolist()
    begun = [trial["from"] + film.start for trial in counted]
    assert begun == pytest.approx(table["started"].tolist(), abs=1e-4)
    assert film.gaps == []
    cut = Film(open_recording(file).session(1), "cut")
    cut.time = np.delete(cut.time, np.s_[100:200])
    ((begin, end),) = cut.gaps
    assert end - begin == pytest.approx(101 / 240, abs=1e-6)


def test_the_target_and_the_cue_are_drawn_where_the_record_has_them(file: Path, film: Film) -> None:
    cues, lacking = film.cues(discover())
    assert (list(cues), lacking) == (["ball"], [])
    shapes = ShownShapes(cues)
    shapes.take(film.run)
    task = open_recording(file).session(1).streams["task"].data
    seen = 0
    for at in moments(film.length, 40):
        shapes.situate(film.situation(at))
        drawn = {shape.name: shape for shape in shapes.shapes(film.frame(at))}
        row = task.iloc[film.index(at)]
        where = row[[f"target.position.{axis}" for axis in "xyz"]].tolist()
        if "target" in drawn:
            assert list(drawn["target"].centre) == where
        if "sphere" in drawn:
            seen += 1
            assert list(drawn["sphere"].centre) == where
    assert seen > 20


def test_a_session_without_frames_says_that_there_is_nothing_to_see(file: Path) -> None:
    record = open_recording(file).session(1)
    del record.streams["state"]
    with pytest.raises(RecordingError, match=r"P001 has no frames of 'state'; there is nothing"):
        Film(record, "P001")
    with pytest.raises(
        RecordingError, match=r"has no column 'joint'; it has time, joint.angle.slew"
    ):
        open_recording(file).session(1).streams["state"].column("joint")


class Heard(Film):
    """A film of which one signal is known."""

    def __init__(self, time_s: np.ndarray, values: np.ndarray) -> None:
        self.heard = time_s, values

    def _signal(self, stream: str, column: str) -> tuple[np.ndarray, np.ndarray]:
        return self.heard


def test_a_spectrogram_has_a_tone_at_its_frequency_and_its_loudness_and_gaps_stay_gaps() -> None:
    rate_hz, draw = 1000.0, np.random.default_rng(7)
    time_s = np.arange(60_000) / rate_hz
    for tone_hz in draw.uniform(20.0, 480.0, 8):
        amplitude = draw.uniform(0.5, 20.0)
        film = Heard(time_s, amplitude * np.sin(2 * np.pi * tone_hz * time_s) + 3.0)
        found = film.spectrogram("Audio", "left", 0.0, 60.0)
        bins = np.array(found["levels"])
        assert bins.shape == (STEPS, WINDOW_SAMPLES // 2)
        step_hz = rate_hz / WINDOW_SAMPLES
        at = (bins.argmax(axis=1) + 1) * step_hz  # the mean is left out
        assert np.abs(at - tone_hz).max() <= step_hz
        assert found["top_hz"] == pytest.approx(500.0)
        # A sine's power is half its amplitude squared; Hann spreads it over 1.5 bins, and loses
        # up to 1.42 dB where the tone is between two.
        whole_db = 10 * np.log10(amplitude**2 / 2 / (1.5 * step_hz))
        assert whole_db - 1.5 <= found["most_db"] <= whole_db + 0.1
    gap = (time_s < 20.0) | (time_s > 30.0)
    film = Heard(time_s[gap], np.sin(time_s[gap]))
    steps = film.spectrogram("Audio", "left", 0.0, 60.0)["levels"]
    assert sum(row is None for row in steps) in {1, 2}, "only what the gap is in"
    film = Heard(time_s, np.where(time_s < 30.0, np.nan, np.sin(time_s)))
    steps = film.spectrogram("Audio", "left", 0.0, 60.0)["levels"]
    assert [row is None for row in steps[:145] + steps[155:]] == [True] * 145 + [False] * 145
    with pytest.raises(RecordingError, match="needs 512 samples, and Audio left has 100 there"):
        film.spectrogram("Audio", "left", 0.0, 0.1)


def copied(file: Path, folder: Path) -> Path:
    """Return a participant's folder with the journals only."""
    there = folder / file.parent.name
    there.mkdir()
    for journal in file.parent.glob("ses-01_*"):
        shutil.copy(journal, there)
    return there


def same_as_far_as(film: Film, cut: Film) -> None:
    for at in moments(cut.length, 30):
        whole, part = film.frame(at), cut.frame(at)
        assert part == pytest.approx(whole, abs=0.0, nan_ok=True)


@pytest.mark.parametrize("share", [0.6, 0.9])
def test_a_killed_session_is_shown_as_far_as_its_journal_goes_and_nothing_is_written(
    share: float, file: Path, film: Film, tmp_path: Path
) -> None:
    folder = copied(file, tmp_path)
    journal = folder / "ses-01_run.xdf"
    journal.write_bytes(journal.read_bytes()[: int(share * journal.stat().st_size)])
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    said: list[str] = []
    cut = Film(opened(folder, 1, tmp_path / "scratch", said.append), "cut")
    assert 0.3 * film.length < cut.length < film.length
    same_as_far_as(film, cut)
    assert "shown is what its journals hold" in said[0]
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before


def test_a_damaged_participant_file_is_shown_from_its_journals(
    file: Path, film: Film, tmp_path: Path
) -> None:
    folder = copied(file, tmp_path)
    damaged = folder / file.name
    damaged.write_bytes(file.read_bytes()[:4000])
    said: list[str] = []
    whole = Film(opened(damaged, 1, tmp_path / "scratch", said.append), "whole")
    assert (len(whole.time), len(said)) == (len(film.time), 1)
    same_as_far_as(film, whole)
    for journal in folder.glob("*.xdf"):
        journal.unlink()
    with pytest.raises(RecordingError, match=r"P001-SIMULATED\.h5"):
        opened(damaged, 1, tmp_path / "other", said.append)


def test_two_trials_are_shown_from_their_starts_side_by_side(file: Path, film: Film) -> None:
    table = open_recording(file).session(1).trials.set_index("trial")
    one, other = table.index[:2]
    apart_s = table.loc[other, "started"] - table.loc[one, "started"]
    assert film.start_of(other) - film.start_of(one) == pytest.approx(apart_s, abs=1e-3)
    with pytest.raises(RecordingError, match=r"has no trial 9; there are 2 to 3"):
        film.start_of(9)
    with pytest.raises(RecordingError, match="no trial 7"):
        check_view(file, "--trial", f"{one:g}", "--beside-trial", "7")
    assert main(["view", str(file), "--beside-trial", "2"]) == 2


def check_view(file: Path, *words: str) -> None:
    """Have the command look at a file, and let what it raises through."""
    import typer

    from labcrane.cli.commands.results import view

    app = typer.Typer()
    app.command()(view)
    app([str(file), *words], standalone_mode=False)


POSES = """
const found = {};
window['scene_' + document.querySelector('.nicegui-scene').id].traverse(o => {
    if (o.name.startsWith('body ')) { o.updateWorldMatrix(true, false);
        found[o.name.slice(5)] = o.matrixWorld.elements; }
});
return found;
"""
AS_SPECTROGRAM = """
const field = document.getElementById('as-0');
field.value = 'spectrogram';
field.dispatchEvent(new Event('change'));
"""
PAINTED = """
const canvas = document.getElementById('spectrum-0');
const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
return pixels.filter((v, n) => n % 4 === 0 && v > 64).length;
"""
GO = """
const field = document.getElementById('second');
field.value = arguments[0];
field.dispatchEvent(new Event('change'));
"""


@pytest.mark.long
def test_the_page_shows_the_recorded_pose_at_any_time(
    file: Path, browser: webdriver.Chrome
) -> None:
    record = open_recording(file).session(1)
    film = Film(record, file.stem)
    words = [sys.executable, "-m", "labcrane", "view", str(file), "--beside", str(file)]
    viewer = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        link = next(line for line in viewer.stdout if line.startswith("viewer: ")).split()[1]
        wait_for(lambda: reached(browser, link))
        shown(browser, "clock", "of 0:00:")
        wait_for(lambda: text(browser, "range-0"))
        check(browser, "viewer")
        browser.execute_script(AS_SPECTROGRAM)
        wait_for(lambda: "dB" in text(browser, "heard-0"))
        assert browser.execute_script(PAINTED) > 100
        check(browser, "viewer with a spectrogram")
        machine, times = film.machine, moments(film.length)
        angles = record.streams["state"].data[[f"joint.angle.{n}" for n in machine.names]]
        for at in times:
            row = angles.iloc[film.index(at)].to_numpy(float)
            frames = link_frames(machine, row)
            wanted = {body.name: frames[body.frame] for body in film.run.bodies}
            browser.execute_script(GO, at)
            wait_for(lambda wanted=wanted: apart(browser, wanted) < 1e-6, 10.0)
    finally:
        viewer.terminate()
        viewer.wait(30)
        viewer.stdout.close()


def reached(browser: webdriver.Chrome, link: str) -> bool:
    """Whether the viewer is served: its link is printed before it is."""
    from selenium.common.exceptions import WebDriverException

    try:
        browser.get(link)
    except WebDriverException:
        return False
    return bool(browser.find_elements(By.ID, "scrub"))


def apart(browser: webdriver.Chrome, wanted: dict[str, np.ndarray]) -> float:
    """Return how far the bodies on the page are from these poses at most, in m and as cosines."""
    found = browser.execute_script(POSES)
    return max(
        float(np.abs(np.array(found[name]).reshape(4, 4).T - pose).max())
        for name, pose in wanted.items()
    )
