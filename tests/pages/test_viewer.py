"""The viewer: poses, curves and events are those of the record; its page shows them."""

import random
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pandas as pd
import pytest
from faults.sessions import unique, wait_for
from pages.looks import check
from pages.room import shown, text
from pages.test_reach import ACKNOWLEDGED, AWAY
from rehearsal import simulated_file
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from simple_crane import FORM

from labcrane import RecordingError, open_recording
from labcrane.core import Event
from labcrane.machines import link_frames
from labcrane.testing import discover, main
from labcrane.web.control_room.shown import ShownShapes
from labcrane.web.translations import WORDS
from labcrane.web.viewer.film import POINTS, STEPS, WINDOW_SAMPLES, Film
from labcrane.web.viewer.glances import Glances
from labcrane.web.viewer.marks import Marks
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
    return simulated_file(tmp_path_factory.mktemp("viewed"), STUDY.format(study=unique("viewed")))


@pytest.fixture(scope="module")
def film(file: Path) -> Film:
    return Film(open_recording(file).session(1), file.stem)


def test_the_time_line_has_each_pause_and_loss_from_its_beginning_to_its_end(film: Film) -> None:
    """Against each tenth of a second by itself, for random orders of losses and returns."""
    parts = [
        ("pause.start", "pause.end", {"by": "operator"}),
        ("pause.start", "pause.end", {"by": "feedback main"}),
        ("input.lost", "input.back", {}),
        ("stream.lost", "stream.back", {"what": "eeg"}),
        ("feedback.lost", "feedback.ready", {"what": "main"}),
        ("feedback.lost", "feedback.ready", {"what": "tone"}),
    ]
    for seed in range(20):
        draw = random.Random(seed)
        times = sorted(draw.sample(range(1, int(10 * film.length)), 40))
        down, happened, expected = set(), [], {}
        for at, until in zip(times, [*times[1:], None], strict=True):
            part = draw.randrange(len(parts))
            begin, end, data = parts[part]
            lost = draw.random() < 0.6  # also twice in a row, and back where nothing was lost
            why = {"why": "it broke"} if begin.endswith("lost") else {}
            facts = {"facts": "{}"} if end == "feedback.ready" else {}
            named = (
                (begin, {**data, **why, "left_out": False}) if lost else (end, {**data, **facts})
            )
            happened.append(Event(named[0], film.start + at / 10, named[1]))
            down = down | {part} if lost else down - {part}
            span = range(at, until if until is not None else int(10 * film.length))
            expected |= {tenth: sorted(down) for tenth in span}
        told = Film(film._record, film.called)
        told.__dict__["_happened"] = happened
        for tenth, parts_down in expected.items():
            at = tenth / 10 + 0.05
            here = [one for one in told.breaks if one["from"] <= at < one["to"]]
            kinds = sorted("paused" if "pause" in parts[part][0] else "lost" for part in parts_down)
            assert sorted(one["kind"] for one in here) == kinds, (seed, tenth)


AREAS = ("main.tip", "main.target", "main.far")


@pytest.fixture(scope="module")
def gazed(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same session with eyes at 200 Hz and a view's areas at 60 Hz, in a place of its own."""
    import h5py

    from labcrane.recording import Channel, StreamHeader
    from labcrane.recording.participant_file.columns import (
        write_attributes,
        write_numbers,
        write_text,
    )

    folder = tmp_path_factory.mktemp("gazed") / file.parent.name
    shutil.copytree(file.parent, folder)
    draw, path = np.random.default_rng(23), folder / file.name

    def write(session: h5py.Group, name: str, kind: str, rate_hz: float, columns: dict) -> None:
        stream = session.create_group(f"streams/{name}")
        about = {"name": name, "type": kind, "rate_hz": rate_hz, "space": "screen"}
        write_attributes(stream, about)
        channels = tuple(Channel(label, "px") for label in columns if label != "time")
        write_text(stream, "header", StreamHeader(name, kind, channels, rate_hz=rate_hz).xml)
        for column in ("time_raw", "time"):
            write_numbers(stream, column, columns["time"], "s")
        data = stream.create_group("data")
        for at, (label, values) in enumerate(columns.items()):
            if label != "time":
                write_numbers(data, f"c{at}", values, "px")
                write_attributes(data[f"c{at}"], {"position": at, "name": label})

    with h5py.File(path, "r+") as opened_file:
        session = opened_file["ses-01"]
        begin, end = session["time"][0], session["time"][-1]
        shown_s = np.arange(begin + 0.5, end, 1 / 60)
        boxes = {"time": shown_s}
        for name in AREAS:
            left, top = draw.uniform(0, 900, len(shown_s)), draw.uniform(0, 500, len(shown_s))
            sides = (left, top, left + draw.uniform(50, 600), top + draw.uniform(50, 400))
            gone = draw.random(len(shown_s)) < 0.1
            for side, values in zip(("left", "top", "right", "bottom"), sides, strict=True):
                boxes[f"{name}.{side}"] = np.where(gone, np.nan, values)
        write(session, "labcrane.feedback.operator.areas", "Feedback", 0.0, boxes)
        time_s = np.arange(begin, end, 1 / 200)
        time_s = time_s[(time_s < begin + 8.0) | (time_s > begin + 10.0)]
        x, y = draw.uniform(0, 1280, len(time_s)), draw.uniform(0, 800, len(time_s))
        x[draw.random(len(x)) < 0.05] = np.nan
        write(session, "eyes", "Gaze", 200.0, {"time": time_s, "gaze_x": x, "gaze_y": y})
    return path


@pytest.mark.slow
def test_a_glance_has_the_areas_of_the_newest_picture_and_the_smallest_one_that_is_looked_at(
    gazed: Path,
) -> None:
    record = open_recording(gazed).session(1)
    film = Film(record, "gazed")
    eyes, pictures = record.streams["eyes"], record.streams["labcrane.feedback.operator.areas"]
    assert film.glances.known
    boxes = {
        name: pictures.data[[f"{name}.{s}" for s in ("left", "top", "right", "bottom")]].to_numpy(
            float
        )
        for name in AREAS
    }
    gaze = eyes.data[["gaze_x", "gaze_y"]].to_numpy()
    looked = set()
    for at in [0.2, 9.0, *moments(film.length, 600)]:
        now = film.start + at
        glance = film.glances.at(at)
        shown = pictures.time <= now + 1e-9
        newest = {name: tuple(box[shown][-1]) for name, box in boxes.items() if shown.any()}
        wanted = {name: box for name, box in newest.items() if np.isfinite(box).all()}
        assert glance.areas == wanted
        during = (eyes.time > now - 0.5) & (eyes.time <= now + 1e-9)
        trail = gaze[during]
        assert abs(len(glance.trail) - len(trail)) <= 1, "a sample at the very edge"
        if not len(trail):
            assert glance.looked == ""
            continue
        x, y = trail[-1]
        inside = [
            ((box[2] - box[0]) * (box[3] - box[1]), name)
            for name, box in wanted.items()
            if box[0] <= x <= box[2] and box[1] <= y <= box[3]
        ]
        assert glance.looked == (min(inside)[1] if inside else "")
        looked.add(glance.looked)
    assert looked == {"", *AREAS}
    lane = film.glances.lane(7.5, 10.5)
    assert set(lane[105:245]) == {""}, "nothing is looked at while the eyes are not recorded"
    assert any(lane)


def test_gaze_that_is_named_by_area_needs_no_picture_and_a_session_without_gaze_shows_none(
    film: Film,
) -> None:
    assert film.glances.known is False

    class Eyes:
        """A gaze stream that names areas by numbers; a blink is NaN."""

        def __init__(self) -> None:
            self.attrs, self.name, self.units = {"type": "Gaze"}, "eyes", {"aoi": ""}
            self.time, self.header = np.arange(0.0, 4.0, 0.01), None

        def column(self, name: str, first: int, last: int) -> np.ndarray:
            areas = np.where(self.time < 1, 0.0, np.where(self.time < 2, 2.0, np.nan))
            return areas[first:last]

    class Recorded:
        """A session with nothing but eyes."""

        context: Mapping[str, object] = MappingProxyType({})

        def __init__(self) -> None:
            self.streams = {"eyes": Eyes()}

    glances = Glances(Recorded(), -1.0)
    assert glances.known
    assert [glances.at(at).looked for at in (1.5, 2.5, 3.5, 9.0)] == ["", "2", "", ""]


def moments(length: float, count: int = 100) -> list[float]:
    draw = random.Random(23)
    return [draw.uniform(0.0, length) for _ in range(count)]


@pytest.mark.slow
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


def test_a_recorded_sound_is_no_cue_that_is_lacking(
    film: Film, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded = [("tone", "sonification", {}), ("ball", "sphere", {"at": "tip"}), ("x", "gone", {})]
    monkeypatch.setattr(Film, "_recorded_cues", lambda _: iter(recorded))
    cues, (why,) = film.cues(discover())
    assert list(cues) == ["ball"]
    assert why.startswith("cue 'x' is not shown: cue 'gone' is not installed")


def test_a_session_without_frames_says_that_there_is_nothing_to_see(file: Path) -> None:
    record = open_recording(file).session(1)
    del record.streams["state"]
    with pytest.raises(RecordingError, match=r"P001 has no frames of 'state', so there is nothing"):
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
    assert "its journals are shown instead" in said[0]
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before


@pytest.mark.slow
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


def test_marks_of_a_copy_are_refused_on_the_page_with_why_and_those_of_a_place_are_kept(
    file: Path, tmp_path: Path
) -> None:
    folder = copied(file, tmp_path)
    placed = folder / file.name
    shutil.copy(file, placed)
    record = open_recording(placed).session(1)
    marks = Marks(Film(record, "placed", (placed, 1)))
    assert marks.shown()["marks"] == []
    told = marks.asked({"t": 1.25, "to": 2.5, "text": "here"})
    assert (told["markSaid"], [(one["t"], one["to"]) for one in told["marks"]]) == (
        "kept",
        [(1.25, 2.5)],
    )
    away = tmp_path / file.name
    shutil.copy(file, away)
    told = Marks(Film(record, "away", (away, 1))).asked({"t": 1.0, "to": 1.0, "text": "x"})
    assert told["markSaid"].startswith(f"not kept: {away} is not in its place")
    for rubbish in ({}, {"t": "x", "to": 1, "text": "x"}, {"withdraw": None}, {"withdraw": 9}):
        assert marks.asked(rubbish)["markSaid"].startswith("not kept: ")
    assert Marks(Film(record, "nowhere")).asked({"t": 1.0})["marking"] is False
    assert record.annotations["text"].tolist() == ["here"]


def test_two_trials_are_shown_from_their_starts_side_by_side(file: Path, film: Film) -> None:
    table = open_recording(file).session(1).trials.set_index("trial")
    one, other = table.index[:2]
    apart_s = table.loc[other, "started"] - table.loc[one, "started"]
    assert film.start_of(other) - film.start_of(one) == pytest.approx(apart_s, abs=1e-3)
    with pytest.raises(RecordingError, match=r"has no trial 9; there are 2 to 3"):
        film.start_of(9)
    begun = open_recording(file).session(1).events.set_index("name")["time"]["trial.start"]
    assert film.time_of("trial.start") == pytest.approx(begun.iloc[0] - film.start)
    assert film.time_of("2.5") == 2.5
    with pytest.raises(RecordingError, match=r"did you mean 'trial\.start'"):
        film.time_of("trial.strat")
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
AS_CURVE = AS_SPECTROGRAM.replace("'spectrogram'", "'curve'")
LOST = 4
LOSE = f"""
const emit = window.socket.emit;
window.lost = 0;
window.socket.emit = (...words) => {{
    if (words[0] === 'event' && window.lost < {LOST}) window.lost += 1;
    else emit.apply(window.socket, words);
}};
"""
"""Loses what the page says next, as a socket does that was closed before the page knows of it."""

PAINTED = """
const canvas = document.getElementById('spectrum-0');
const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
return pixels.filter((v, n) => n % 4 === 0 && v > 64).length;
"""
SHAPES = """
return [...document.querySelectorAll('.nicegui-scene')].map(element => {
    const found = [];
    window['scene_' + element.id].traverse(o => {
        if (o.name && !o.name.startsWith('body ') && o.material)
            found.push([o.name, o.visible, o.position.toArray(), o.material.color.getHex(),
                        o.material.opacity, o.material.transparent && o.material.depthWrite]);
    });
    return JSON.stringify(found.sort());
});
"""
GO = """
const field = document.getElementById('second');
field.value = arguments[0];
field.dispatchEvent(new Event('change'));
"""


@pytest.mark.long
def test_the_page_shows_the_recorded_pose_at_any_time(
    gazed: Path, browser: webdriver.Chrome
) -> None:
    file = gazed
    record = open_recording(file).session(1)
    film = Film(record, file.stem)
    angles = record.streams["state"].data[[f"joint.angle.{n}" for n in film.machine.names]]
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
        lose_messages(browser, lambda at: pose(film, angles, at))
        wait_for(lambda: len(set(browser.execute_script(SHAPES))) == 1)  # alike in both places
        browser.execute_script(GO, 4.0)
        heights = film.curve("state", "tip.position.z", 0.0, film.length)
        step = int(POINTS * 4.0 / film.length)
        low, high = heights["low"][step], heights["high"][step]
        wait_for(lambda: near(text(browser, "value-2"), low, high))
        mark_and_take_back(browser, file, film)
        look_at_areas(browser, film)
        for at in moments(film.length):
            wanted = pose(film, angles, at)
            browser.execute_script(GO, at)
            wait_for(lambda wanted=wanted: apart(browser, wanted) < 1e-6)
        viewer.send_signal(signal.SIGSTOP)
        wait_for(lambda: WORDS["en"].stale in text(browser, "stale"))
        check(browser, "viewer-stale")
        viewer.send_signal(signal.SIGCONT)
        wait_for(lambda: not text(browser, "stale"))
    finally:
        viewer.send_signal(signal.SIGCONT)
        viewer.terminate()
        viewer.wait(240)
        viewer.stdout.close()


def pose(film: Film, angles: pd.DataFrame, at: float) -> dict[str, np.ndarray]:
    """Return where each body was, by its name."""
    frames = link_frames(film.machine, angles.iloc[film.index(at)].to_numpy(float))
    return {body.name: frames[body.frame] for body in film.run.bodies}


def lose_messages(
    browser: webdriver.Chrome, pose_at: Callable[[float], dict[str, np.ndarray]]
) -> None:
    """See that what is asked while a connection dies is asked again, and that the page stays."""
    said = text(browser, "heard-0")
    browser.execute_script(LOSE)
    browser.execute_script(GO, 7.5)
    browser.execute_script(AS_CURVE)
    wait_for(lambda: browser.execute_script("return window.lost") == LOST)
    wait_for(lambda: apart(browser, pose_at(7.5)) < 1e-6)
    wait_for(lambda: text(browser, "range-0"))
    browser.execute_script(AS_SPECTROGRAM)
    wait_for(lambda: text(browser, "heard-0") == said)
    wait_for(lambda: browser.execute_script(ACKNOWLEDGED))
    browser.set_script_timeout(240)
    assert browser.execute_async_script(AWAY, 5000), "longer than NiceGUI keeps a page by itself"
    browser.execute_script(GO, 2.5)
    wait_for(lambda: apart(browser, pose_at(2.5)) < 1e-6)
    assert browser.execute_script("return window.stays"), "it was not loaded anew"
    assert text(browser, "heard-0") == said


def near(said: str, low: float, high: float) -> bool:
    """Whether a reading has the lowest and the highest value of a step, to four digits."""
    found = [float(word) for word in said.split() if word[-1].isdigit()]
    return bool(found) and [min(found), max(found)] == pytest.approx([low, high], rel=6e-4)


def look_at_areas(browser: webdriver.Chrome, film: Film) -> None:
    """See that the areas of the picture, and the one that is looked at, are drawn as recorded."""
    drawn = "return [...document.querySelectorAll('#gaze rect')].map(r => [r.textContent.trim(), "
    drawn += "r.x.baseVal.value, r.y.baseVal.value, r.classList.contains('looked')])"
    wait_for(lambda: browser.find_elements(By.CSS_SELECTOR, ".view-lane rect"))
    for at in moments(film.length, 10):
        glance = film.glances.at(at)
        browser.execute_script(GO, at)
        wanted = [
            [name, pytest.approx(box[0], abs=0.01), pytest.approx(box[1], abs=0.01),
             name == glance.looked]
            for name, box in glance.areas.items()
        ]  # fmt: skip
        wait_for(lambda wanted=wanted: browser.execute_script(drawn) == wanted)
        assert text(browser, "looked").startswith(glance.looked or "no area")


def mark_and_take_back(browser: webdriver.Chrome, file: Path, film: Film) -> None:
    """Mark a stretch and a moment by keyboard and buttons, take one back; all is in the record."""
    record = open_recording(file).session(1)
    browser.execute_script(GO, 2.0)
    browser.find_element(By.ID, "mark-from").click()
    browser.execute_script(GO, 3.5)
    browser.find_element(By.TAG_NAME, "body").send_keys("m")
    browser.switch_to.active_element.send_keys("looked away", Keys.ENTER)
    wait_for(lambda: text(browser, "mark-said") == "kept")
    (mark,) = record.annotations.itertuples()
    assert (mark.time, mark.until) == pytest.approx((film.start + 2.0, film.start + 3.5), abs=1e-6)
    assert mark.text == "looked away"
    browser.find_element(By.ID, "mark-text").send_keys("a slip")
    browser.find_element(By.ID, "mark-add").click()
    wait_for(lambda: "a slip" in text(browser, "marks"))
    assert record.annotations["time"].tolist()[1] == pytest.approx(film.start + 3.5, abs=1e-6)
    assert len(browser.find_elements(By.CLASS_NAME, "view-mark")) == 2
    check(browser, "viewer with marks")
    browser.find_element(By.CSS_SELECTOR, "[aria-label='Withdraw: a slip']").click()
    wait_for(lambda: "withdrawn" in text(browser, "mark-said"))
    assert "a slip" not in text(browser, "marks")
    assert record.annotations["text"].tolist() == ["looked away"]


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
