"""Recordings of before: a session recorded by commit 721f9c3 is read, recorded and run as it was.

``before/`` holds its protocol, its journal and its participant file, compressed. The numbers are
those of a simulation, so that today's code must make them again, bit for bit.
"""

import gzip
import json
import math
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
import pyxdf
from programs import ran

import labcrane
from labcrane.analysis import movements_of
from labcrane.analysis.measures import measure_session

BEFORE = Path(__file__).parent / "before"
NAME = "P001-SIMULATED"
OF_THE_COMPUTER = {"versions", "sync"}
"""What the start of a session says of the program: versions, and the limits that it judges by."""
ADDED_RESULTS = {
    "circle_to_circle", "between_circles", "onset_to_rest", "at_rest", "movement_onset",
    "onset_speed", "onset_hold",
}  # fmt: skip
"""What is measured since at the end of an aiming movement."""
ADDED = {"done", "owed", *ADDED_RESULTS}
"""What events say since, beside all that they said: whether a step was done, what is owed, and what
is measured."""
ADDED_UNITS = {"practice", "reference", "track_success"}
"""Truth values whose unit, 1, the start of a session says since."""
BY_ANOTHER_RULE = {"reaction_time", "movement_time", "path_length"}
"""What is measured otherwise since: from the first onset, not from that of the fastest stroke."""
ONSET = "movement.onset"
"""It is told as soon as it is known since, and no more with the trial's end."""
ADDED_SETTINGS = {"axes": [], "button": None, "response": None}
"""What the simulated operator can be told since, and what that is where it is not."""
FORMER_SETTINGS = {"patience_m": 0.6, "still_m_s": 0.015, "press_s": 0.1}
"""What it could be told then, and what is the same for all since."""
DEFINITION = "definition"
"""What columns of the loop and of all trials say of themselves since."""
ABOUT_THE_FILE = {"README", "dataset_description", "CITATION"}
"""What every participant file says of itself since."""
ADDED_COLUMNS = {
    *(f"ses-01/trials/{name}" for name in ADDED_RESULTS),
    *ABOUT_THE_FILE,
}
OF_ANOTHER_RULE = {f"ses-01/trials/{name}" for name in BY_ANOTHER_RULE}
OF_THE_JOURNAL = {"ses-01/journals/size", "ses-01/context"}
"""How long versions' names are; the context is compared by its content."""


def labcrane_command(*arguments: str | Path) -> str:
    done = ran([sys.executable, "-m", "labcrane", *map(str, arguments)])
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def before(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the participant as it was then."""
    folder = tmp_path_factory.mktemp("before")
    for packed in BEFORE.glob("*.gz"):
        (folder / packed.stem).write_bytes(gzip.decompress(packed.read_bytes()))
    return folder


@pytest.fixture(scope="module")
def now(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a participant who does the same today."""
    data = tmp_path_factory.mktemp("now")
    protocol = BEFORE / "protocol.yaml"
    labcrane_command(
        "run", protocol, "--participant", "P001", "--simulate", "--fast", "--data", data
    )
    return data / NAME


def journal(folder: Path) -> dict[str, Mapping[str, Any]]:
    """Return the streams of a journal, read by pyxdf."""
    streams, _ = pyxdf.load_xdf(
        folder / "ses-01_run.xdf", synchronize_clocks=False, dejitter_timestamps=False
    )
    return {stream["info"]["name"][0]: stream for stream in streams}


def events(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(row[0]) for row in journal(folder)["labcrane.events"]["time_series"]]


def unlike(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """Return what an event says otherwise than before; what is :data:`ADDED` may be there."""
    kept = {name: value for name, value in new.items() if name in old or name not in ADDED}
    old, kept = (
        {name: value for name, value in each.items() if name not in BY_ANOTHER_RULE}
        for each in (old, kept)
    )
    same = kept.keys() == old.keys() and all(alike(kept[name], old[name]) for name in old)
    return {} if same else {"was": old, "is": new}


LAST_BITS = 1e-15
"""Relative: lengths were rounded by Python's dist, which changed in 3.12, and are roots now."""


def alike(old: Any, new: Any) -> bool:
    if isinstance(old, float) and isinstance(new, float):
        return math.isclose(old, new, rel_tol=LAST_BITS) or (math.isnan(old) and math.isnan(new))
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        return old.keys() == new.keys() and all(alike(old[key], new[key]) for key in old)
    return bool(old == new)


def datasets(folder: Path) -> dict[str, tuple[Any, dict[str, Any]]]:
    """Return what is in a participant file, read by h5py: values and attributes, by path."""
    found: dict[str, tuple[Any, dict[str, Any]]] = {}

    def note(path: str, node: h5py.HLObject) -> None:
        if isinstance(node, h5py.Dataset):
            attributes = {
                name: value
                for name, value in node.attrs.items()
                if name not in {"REFERENCE_LIST", "DIMENSION_LIST", DEFINITION}
            }
            found[path] = (node[()], attributes)

    with h5py.File(folder / f"{NAME}.h5") as file:
        file.visititems(note)
    return found


def test_the_same_seed_writes_the_same_frames_bit_for_bit(before: Path, now: Path) -> None:
    old, new = (journal(folder)["labcrane.frames"] for folder in (before, now))
    assert len(old["time_stamps"]) > 400
    assert old["time_stamps"].tobytes() == new["time_stamps"].tobytes()
    assert old["time_series"].tobytes() == new["time_series"].tobytes()
    assert old["info"]["desc"] == new["info"]["desc"]


def test_the_same_seed_writes_the_same_events(before: Path, now: Path) -> None:
    old, new = events(before), events(now)
    start, again = old.pop(0), new.pop(0)
    kept = start.keys() - OF_THE_COMPUTER
    assert len(kept) > 25
    units = again["trial_units"]
    again["trial_units"] = {name: units[name] for name in units if name not in ADDED | ADDED_UNITS}
    for block in again["plan"]:
        assert not {"practice", "counted"} - block.keys()
        del block["practice"], block["counted"]
    assert start["components"]["tasks.aiming"]["settings"].pop("onset_share") == 0.05
    operator = again["components"]["input"]["settings"]
    former = start["components"]["input"]["settings"]
    assert {name: former.pop(name) for name in FORMER_SETTINGS} == FORMER_SETTINGS
    assert {name: operator.pop(name) for name in ADDED_SETTINGS} == ADDED_SETTINGS
    for part, choice in again["components"].items():
        if part.startswith("questionnaires.") and "text" in choice["settings"]:
            assert {choice["settings"].pop(name) for name in ("file", "text")} == {None}
    assert {name: again[name] for name in kept} == {name: start[name] for name in kept}
    assert len(new) == len(old)
    stamps = [journal(folder)["labcrane.events"]["time_stamps"][1:] for folder in (before, now)]
    was, found = (
        [row for row in zip(rows, of, strict=True) if row[0]["event"] != ONSET]
        for rows, of in zip((old, new), stamps, strict=True)
    )
    assert len(found) == len(was) < len(new)
    assert not [unlike(a, b) for (a, _), (b, _) in zip(was, found, strict=True) if unlike(a, b)]
    assert [stamp for _, stamp in was] == [stamp for _, stamp in found]


def test_the_same_seed_makes_the_same_datasets(before: Path, now: Path) -> None:
    old, new = datasets(before), datasets(now)
    assert new.keys() - ADDED_COLUMNS == old.keys()
    others = [each["ses-01/events/name"][0] != ONSET.encode() for each in (old, new)]
    for path in sorted(old.keys() - OF_THE_JOURNAL - OF_ANOTHER_RULE):
        (was, attributes), (values, described) = old[path], new[path]
        if path.startswith("ses-01/events/"):
            was, values = was[others[0]], values[others[1]]
        if path.startswith("ses-01/trials/"):  # those that were added stand in between
            described, attributes = dict(described), dict(attributes)
            assert described.pop("position") >= attributes.pop("position")
            described.pop("definition", None)  # which results have now
        assert described == attributes, path
        if path == "ses-01/events/data":  # the first is the start, compared above
            was, values = was[1:], values[1:]
            was, values = ([json.loads(text) for text in texts] for texts in (was, values))
            assert len(values) == len(was)
            assert not any(unlike(*pair) for pair in zip(was, values, strict=True))
            continue
        assert np.asarray(values).dtype == np.asarray(was).dtype, path
        if path.startswith("ses-01/trials/") and np.asarray(was).dtype.kind == "f":
            np.testing.assert_allclose(values, was, rtol=LAST_BITS, atol=0.0, err_msg=path)
            continue
        assert np.asarray(values).tobytes() == np.asarray(was).tobytes(), path


def test_a_recording_of_before_is_measured_from_the_onset_that_it_has(before: Path) -> None:
    session = labcrane.open_recording(before / f"{NAME}.h5").session(1)
    measured, trials = measure_session(session), session.trials
    for name in BY_ANOTHER_RULE:
        np.testing.assert_array_equal(measured[name], trials[name], err_msg=name)
    for movement in movements_of(session):
        assert movement.span is not None
        began, last = (movement.elapsed[at] for at in (movement.span.start, movement.span.stop - 1))
        assert began == pytest.approx(movement.result("reaction_time"), abs=1e-9)
        assert last - began == pytest.approx(movement.result("movement_time"), abs=1e-9)
    assert (measured["amplitude"] > 0.0).all()


def test_every_dataset_of_before_reads_as_it_stands(before: Path) -> None:
    recording = labcrane.open_recording(before / f"{NAME}.h5")
    assert (recording.participant, recording.sessions) == (NAME, [1])
    session = recording.session(1)
    stored = datasets(before)
    read = set()
    for group, stream in session.streams.items():
        np.testing.assert_array_equal(stream.time, stored["ses-01/time"][0])
        for column in stream.data:
            path = f"ses-01/{group}/{column.replace('.', '/')}"
            np.testing.assert_array_equal(stream.data[column], stored[path][0])
            assert stream.units[column] == stored[path][1]["unit"]
            read.add(path)
    tables = ("trials", "questionnaires", "events")
    for table in tables:
        frame = getattr(session, table)
        for column in frame:
            path = f"ses-01/{table}/{column}"
            values = stored[path][0]
            if values.dtype.kind == "S":
                texts = [text.decode() for text in values]
                assert list(frame[column]) == (
                    [json.loads(text) for text in texts] if column == "data" else texts
                )
            else:
                np.testing.assert_array_equal(frame[column], values)
            read.add(path)
    groups = {*session.streams, *tables}
    assert read == {path for path in stored if path.split("/")[1] in groups}
    assert session.protocol == (BEFORE / "protocol.yaml").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_replay_of_before_gives_every_number(before: Path) -> None:
    *differences, said = labcrane_command("replay", before / f"{NAME}.h5").strip().splitlines()
    assert said == "454 ticks replayed, every number the same bit for bit"
    # It was recorded on another Python perhaps, which is said and changes no number.
    assert [line for line in differences if not line.startswith("differs: ")] == []


@pytest.mark.slow
def test_the_journal_of_before_makes_the_participant_file_of_before(
    before: Path, tmp_path: Path
) -> None:
    folder = tmp_path / NAME
    folder.mkdir()
    (folder / "ses-01_run.xdf").write_bytes((before / "ses-01_run.xdf").read_bytes())
    labcrane_command("recover", tmp_path)
    old, new = datasets(before), datasets(folder)
    assert new.keys() - ABOUT_THE_FILE == old.keys()
    assert all(
        np.asarray(new[path][0]).tobytes() == np.asarray(old[path][0]).tobytes() for path in old
    )


@pytest.mark.slow
def test_a_report_of_before_has_the_unit_of_everything_that_was_recorded_with_one(
    before: Path, tmp_path: Path
) -> None:
    shutil.copytree(before, tmp_path / "data" / NAME)
    labcrane_command(
        "report", tmp_path / "data", "--include", "simulated", "--out", tmp_path / "out"
    )
    table = pd.read_csv(tmp_path / "out" / "tables" / "definitions.csv", index_col="measure")
    context = labcrane.open_recording(before / f"{NAME}.h5").session(1).context
    assert "trial_definitions" not in context
    measured = set(table.index)
    recorded = {each: unit for each, unit in context["trial_units"].items() if each in measured}
    assert {"movement_time", "reaction_time", "error"} <= recorded.keys()
    assert table.loc[list(recorded), "unit"].to_dict() == recorded
