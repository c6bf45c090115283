import json
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from needs import needs
from programs import ran
from recording.journals import COLUMNS, CONTEXT, frames, stamp, write

from labcrane import RecordingError, open_recording
from labcrane.recording import Recording
from labcrane.recording.frame_log import LOOP
from labcrane.recording.journal import Column, SessionJournal
from labcrane.recording.participant_file import writer
from labcrane.recording.participant_file.recover import recover
from labcrane.recording.participant_file.writer import consolidate
from labcrane.recording.xdf.reader import read_xdf

COUNT = 100


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "P001"
    folder.mkdir()
    return folder


@pytest.fixture
def path(folder: Path) -> Path:
    """A participant file with one session."""
    write(folder / "ses-01_run.xdf", COUNT)
    consolidate(folder / "P001.h5", [folder / "ses-01_run.xdf"])
    return folder / "P001.h5"


@pytest.fixture
def recording(path: Path) -> Recording:
    return open_recording(path)


def nodes(file: h5py.File) -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    file.visititems(lambda name, node: found.append((name, node)))
    return found


def content(path: Path, session: str) -> dict[str, Any]:
    """Everything in a session, down to the bytes."""
    with h5py.File(path) as file:
        inside: dict[str, Any] = {"": dict(file[session].attrs)}
        for name, node in nodes(file[session]):
            values = node[()] if isinstance(node, h5py.Dataset) else None
            if isinstance(values, np.ndarray):
                values = values.tobytes() if values.dtype.kind != "O" else values.tolist()
            inside[name] = (values, dict(node.attrs))
        return inside


def test_streams_hold_what_was_written(recording: Recording) -> None:
    session = recording.session(1)
    assert list(session.streams) == ["loop", "input", "command", "state", "task"]
    for group, stream in session.streams.items():
        wanted = [k for k, column in enumerate(COLUMNS) if column.group == group]
        np.testing.assert_array_equal(stream.data.to_numpy(), frames(COUNT)[:, wanted])
        assert list(stream.data.columns) == [COLUMNS[k].label for k in wanted]
        assert stream.units == {COLUMNS[k].label: COLUMNS[k].unit for k in wanted}
        np.testing.assert_array_equal(stream.time, [stamp(k) for k in range(COUNT)])


def test_a_file_that_is_kept_open_is_looked_through_once_and_read_as_ever(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[Path] = []
    look = writer.check_containment
    monkeypatch.setattr(
        writer, "check_containment", lambda file, of: (looks.append(of), look(file, of))
    )
    read = [stream.data for stream in open_recording(path).session(1).streams.values()]
    assert len(looks) > 5
    looks.clear()
    with writer.kept_open(path):
        again = [stream.data for stream in open_recording(path).session(1).streams.values()]
        assert looks == [path]
        with pytest.raises(RecordingError, match="there is no participant file"):
            open_recording(path.with_name("another.h5"))
    assert all(one.equals(other) for one, other in zip(read, again, strict=True))
    open_recording(path)
    assert len(looks) > 1, "it is closed at the end"


def test_events_hold_name_time_tick_trial_and_the_rest(recording: Recording) -> None:
    events = recording.session(1).events
    assert list(events["name"]) == ["session.start"] + ["trial.end"] * 10
    assert list(events["tick"]) == [0, *range(9, 100, 10)]
    assert list(events["time"]) == [stamp(0), *(stamp(k) for k in range(9, 100, 10))]
    assert list(events["trial"]) == [0, *range(10)]
    assert events["data"][3] == {
        "trial": 2,
        "counted": True,
        "width": 0.3,
        "side": "left",
        "hit": False,
        "movement_time": None,
    }


def test_only_counted_trials_are_rows_and_what_is_missing_stays_missing(
    recording: Recording,
) -> None:
    trials = recording.session(1).trials
    assert list(trials.columns) == ["trial", "width", "side", "hit", "movement_time", "note"]
    assert list(trials["trial"]) == [0, 2, 4, 6, 8]
    assert list(trials["note"]) == ["", "", "late, ąę", "", ""]
    assert list(trials["side"]) == ["left"] * 5
    assert list(trials["hit"]) == [1, 0, 1, 0, 1]
    np.testing.assert_array_equal(trials["movement_time"], [9 / 7, np.nan, 7, 69 / 7, 89 / 7])


def test_a_session_says_what_it_was(recording: Recording) -> None:
    assert recording.participant == "P001"
    assert recording.sessions == [1]
    assert recording.attrs["study"] == "aiming"
    session = recording.session(1)
    assert session.attrs["simulated"] == "yes"
    assert session.attrs["pilot"] == "no"
    assert session.attrs["rate_hz"] == 240.0
    assert session.attrs["seed"] == "12345678901234567890"  # not exact as a number
    assert session.protocol == CONTEXT["protocol"]
    assert session.context == CONTEXT


def test_everything_is_safe_for_r_and_matlab(path: Path) -> None:
    write(path.parent / "ses-02_run.xdf", 0)
    consolidate(path, [path.parent / "ses-02_run.xdf"])
    with h5py.File(path) as file:
        for name, node in [("/", file), *nodes(file)]:
            for attribute, value in node.attrs.items():
                assert isinstance(value, str | np.float64), (name, attribute)
            if not isinstance(node, h5py.Dataset):
                continue
            text = h5py.check_string_dtype(node.dtype)
            assert node.dtype == np.float64 or (text and text.length), name
            assert node.ndim == 1 or (text and node.ndim == 0), name
            assert text or node.attrs["unit"], name
            assert node.compression in (None, "gzip"), name


def test_the_file_says_what_its_phases_and_trial_numbers_mean(path: Path) -> None:
    with h5py.File(path) as file:
        said = file["ses-01/loop/trial"].attrs["definition"]
        assert said == "number of the trial under way; 0 between trials"
        assert "on the screen" in file["ses-01/trials/trial"].attrs["definition"]
        readme = file["README"][()].decode()
    (phase,) = (each for each in LOOP if each.name == "phase")
    assert phase.definition.startswith("0 idle, 1 running, 2 success")
    assert "trial 8 there may be 10 here" in readme
    assert "docs of labcrane" in readme


def test_long_columns_are_compressed(folder: Path) -> None:
    write(folder / "ses-01_run.xdf", 1000)
    consolidate(folder / "P001.h5", [folder / "ses-01_run.xdf"])
    with h5py.File(folder / "P001.h5") as file:
        column = file["ses-01/state/joint/angle/slew"]
        assert column.compression == "gzip"
        assert column.shuffle


def test_another_session_leaves_the_earlier_ones_as_they_were(path: Path) -> None:
    before = content(path, "ses-01")
    write(path.parent / "ses-02_run.xdf", 30, context={**CONTEXT, "session": 2})
    done = consolidate(path, [path.parent / "ses-02_run.xdf"])
    assert (done.session, done.frames, done.events) == (2, 30, 4)
    assert content(path, "ses-01") == before
    assert open_recording(path).sessions == [1, 2]


def test_doing_it_again_changes_nothing(path: Path) -> None:
    before = content(path, "ses-01")
    consolidate(path, [path.parent / "ses-01_run.xdf"])
    assert content(path, "ses-01") == before


def test_a_session_is_not_replaced_by_less(path: Path) -> None:
    journal = path.parent / "ses-01_run.xdf"
    before = path.read_bytes()
    journal.write_bytes(journal.read_bytes()[:3000])
    with pytest.raises(RecordingError, match=r"holds 111 samples of session 1, its journals only"):
        consolidate(path, [journal])
    assert path.read_bytes() == before


def test_parts_with_other_columns_are_joined_by_name(folder: Path) -> None:
    first = folder / "ses-01_run.xdf"
    write(first, 10)
    columns = [Column("state", "new", "m"), COLUMNS[4]]
    with SessionJournal(folder / "ses-01_run.part2.xdf", columns, 240.0) as journal:
        journal.write_frame(5.0, np.array([7.0, 8.0]))
    consolidate(folder / "P001.h5", [first])
    state = open_recording(folder / "P001.h5").session(1).streams["state"].data
    assert state["new"].iloc[-1] == 7.0
    assert state["joint.angle.slew"].iloc[-1] == 8.0
    assert state["new"].iloc[:10].isna().all()
    assert np.isnan(state["joint.angle.shoulder"].iloc[-1])


def test_a_journal_without_a_context_still_becomes_a_recording(folder: Path) -> None:
    with SessionJournal(folder / "ses-03_run.xdf", COLUMNS, 240.0) as journal:
        journal.write_frame(1.0, frames(1)[0])
    (done,) = recover(folder)
    assert done.problem == ""
    session = open_recording(folder / "P001.h5").session(3)
    assert session.context == {}
    assert len(session.streams["state"].time) == 1


@pytest.mark.parametrize("length", [0, 3, 100, 2000])
def test_a_journal_killed_at_its_start_still_becomes_a_recording(folder: Path, length: int) -> None:
    journal = write(folder / "ses-01_run.xdf", 1)
    journal.write_bytes(journal.read_bytes()[:length])
    (done,) = recover(folder)
    assert done.problem == ""
    assert open_recording(folder / "P001.h5").sessions == [1]


def test_damage_is_noted_in_the_result_and_in_the_file(folder: Path) -> None:
    journal = write(folder / "ses-01_run.xdf", COUNT)
    data = bytearray(journal.read_bytes())
    data[data.index(frames(1, 50)[0].tobytes()) + 9] ^= 4
    journal.write_bytes(bytes(data))
    done = consolidate(folder / "P001.h5", [journal])
    assert done.frames == COUNT - 1
    (note,) = done.notes
    assert "ses-01_run.xdf: 81 bytes are damaged" in note
    with h5py.File(folder / "P001.h5") as file:
        assert file["ses-01/journals/damaged"][:].tolist() == [81.0]


def test_journals_are_only_read(path: Path) -> None:
    journal = path.parent / "ses-01_run.xdf"
    assert len(read_xdf(journal).stream("labcrane.frames").stamps) == COUNT
    before = (journal.read_bytes(), journal.stat().st_mtime_ns)
    consolidate(path, [journal])
    assert (journal.read_bytes(), journal.stat().st_mtime_ns) == before


def test_recover_finds_what_is_missing_and_leaves_the_rest_alone(tmp_path: Path) -> None:
    for participant, session in (("P001", 1), ("P001", 2), ("P002", 1)):
        folder = tmp_path / participant
        folder.mkdir(exist_ok=True)
        write(folder / f"ses-{session:02}_run.xdf", 10 * session)
    consolidate(tmp_path / "P001" / "P001.h5", [tmp_path / "P001" / "ses-01_run.xdf"])
    first = recover(tmp_path)
    assert [(r.path.name, r.session, r.done is not None) for r in first] == [
        ("P001.h5", 1, False),
        ("P001.h5", 2, True),
        ("P002.h5", 1, True),
    ]
    files = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.h5")}
    assert all(r.done is None and not r.problem for r in recover(tmp_path))
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.h5")} == files


@needs("links")
def test_a_participants_folder_may_be_a_link_to_another_disk(tmp_path: Path) -> None:
    (tmp_path / "disk-7").mkdir()
    folder = tmp_path / "P001"
    folder.symlink_to(tmp_path / "disk-7")
    write(folder / "ses-01_run.xdf", 10)
    (done,) = recover(folder)
    assert done.path == folder / "P001.h5"
    assert open_recording(done.path).participant == "P001"


def test_recover_takes_in_a_part_that_came_later(path: Path) -> None:
    write(path.parent / "ses-01_run.part2.xdf", 5, first=COUNT)
    (again,) = recover(path.parent)
    assert again.done is not None
    assert again.done.frames == COUNT + 5


def test_one_unreadable_file_does_not_keep_the_others_from_recovery(tmp_path: Path) -> None:
    for participant in ("P001", "P002"):
        (tmp_path / participant).mkdir()
        write(tmp_path / participant / "ses-01_run.xdf", 10)
    (tmp_path / "P001" / "P001.h5").write_bytes(b"not HDF5")
    first, second = recover(tmp_path)
    assert "cannot read" in first.problem
    assert second.done is not None


@pytest.mark.parametrize("name", ["there is no participant file", "not a participant file"])
def test_what_is_no_participant_file_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / "x.h5"
    if name.startswith("not"):
        h5py.File(path, "w").close()
    with pytest.raises(RecordingError, match=name):
        open_recording(path)


def test_importing_the_reader_loads_neither_pandas_nor_h5py() -> None:
    code = (
        "import sys, json, labcrane.recording.participant_file.recover;"
        "print(json.dumps([m for m in ('pandas', 'h5py') if m in sys.modules]))"
    )
    done = ran([sys.executable, "-c", code], check=True)
    assert json.loads(done.stdout) == []
