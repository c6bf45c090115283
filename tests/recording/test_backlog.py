"""A participant file that is older than the journals beside it is not read without a word."""

import shutil
from pathlib import Path

import pytest
from recording.journals import frames, write
from recording.test_kill import killed_writer

from labcrane import RecordingError, open_recording
from labcrane.errors import OutdatedRecordingWarning
from labcrane.recording.participant_file.recover import backlog, recover
from labcrane.recording.participant_file.writer import consolidate
from labcrane.recording.paths import next_part


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return a participant file of one session; its journal is beside it."""
    folder = tmp_path / "P001"
    folder.mkdir()
    consolidate(folder / "P001.h5", [write(folder / "ses-01_run.xdf", 20)])
    return folder / "P001.h5"


def test_a_file_of_all_its_journals_has_no_backlog(path: Path) -> None:
    assert open_recording(path).sessions == [1]  # a warning would fail this test
    shutil.move(path.parent / "ses-01_run.xdf", path.parent.parent)
    assert backlog(path) == {}  # the file has more than the journals that are left


def test_another_segment_of_a_session_is_named_with_its_remedy(path: Path) -> None:
    write(path.parent / "ses-01_run.part2.xdf", 30, first=20)
    with pytest.warns(OutdatedRecordingWarning) as told:
        open_recording(path)
    assert [str(each.message) for each in told] == [
        f"session 1 is only in part in {path}, which is older than the journals beside it; the "
        f"session is still running, or was killed: run labcrane recover {path.parent}"
    ]
    recover(path.parent)
    assert len(open_recording(path).session(1).streams["state"].time) == 50


def test_a_session_that_the_file_lacks_is_named_with_its_remedy(path: Path) -> None:
    write(path.parent / "ses-02_run.xdf", 5)
    with pytest.warns(OutdatedRecordingWarning, match="session 2 is not in .*P001.h5, which is"):
        open_recording(path)


def test_a_file_that_is_in_the_folder_of_its_name_is_named(path: Path) -> None:
    with pytest.raises(RecordingError) as refused:
        open_recording(path.parent.parent / "P001.h5")
    wanted = path.parent.parent / "P001.h5"
    assert str(refused.value) == f"there is no participant file {wanted}; did you mean {path}?"


@pytest.mark.slow
def test_a_file_is_outdated_after_the_writer_of_a_journal_was_killed(path: Path) -> None:
    killed_writer(next_part(path.parent / "ses-01_run.xdf"), 0.1, 0.001)
    with pytest.warns(OutdatedRecordingWarning, match=f"labcrane recover {path.parent}$"):
        held = open_recording(path).session(1).streams["state"]
    assert len(held.time) == 20
    recover(path.parent)
    assert backlog(path) == {}
    assert len(open_recording(path).session(1).streams["state"].time) > len(frames(20))
