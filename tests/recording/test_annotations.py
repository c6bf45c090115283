"""Marks that people make in a recording afterwards: kept beside it, whole, and never in it."""

import json
import os
import random
import sys
import threading
from pathlib import Path

import pytest
from needs import need

from labcrane import RecordingError
from labcrane.files import atomic
from labcrane.recording import annotate, read_annotations, withdraw
from labcrane.recording.annotations import annotations_path


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    folder = tmp_path / "data" / "P001"
    folder.mkdir(parents=True)
    file = folder / "P001.h5"
    file.write_bytes(b"recorded")
    (folder / "ses-01_run.xdf").write_bytes(b"journal")
    return file


def test_marks_come_back_in_the_order_of_their_times_and_nothing_recorded_is_touched(
    recording: Path,
) -> None:
    before = {path.name: (path.read_bytes(), path.stat().st_mtime_ns)
              for path in recording.parent.iterdir()}  # fmt: skip
    draw = random.Random(23)
    asked = []
    for number in range(40):
        at = draw.uniform(0.0, 4000.0)
        text = f"Ziel {number} „verfehlt“ \\ " + draw.choice(["", '"', "\n zweite Zeile", "±µ"])
        until = at + draw.choice([0.0, draw.uniform(0.0, 9.0)])
        mark = annotate(recording, 1, at, text, until)
        assert mark.number == number + 1
        asked.append((at, until, text.strip()))
    found = [(mark.time, mark.until, mark.text) for mark in read_annotations(recording.parent, 1)]
    assert found == sorted(asked)
    assert read_annotations(recording.parent, 2) == []
    after = {path.name: (path.read_bytes(), path.stat().st_mtime_ns)
             for path in recording.parent.iterdir()}  # fmt: skip
    assert after.keys() - before.keys() == {"ses-01_annotations.jsonl"}
    assert before.items() <= after.items()


def test_a_mark_that_is_taken_back_is_shown_no_more_and_stays_in_the_file(recording: Path) -> None:
    for at in (3.0, 1.0, 2.0):
        annotate(recording, 1, at, f"at {at:g}")
    withdraw(recording, 1, 2)
    assert [mark.text for mark in read_annotations(recording.parent, 1)] == ["at 2", "at 3"]
    lines = annotations_path(recording.parent, 1).read_text("utf-8").splitlines()
    assert [json.loads(line).get("text") for line in lines] == ["at 3", "at 1", "at 2", None]
    with pytest.raises(RecordingError, match=r"has no annotation 2; it has 1, 3"):
        withdraw(recording, 1, 2)
    assert annotate(recording, 1, 0.5, "again").number == 5, "a number is nobody else's later"


def test_marks_made_at_once_are_all_kept(recording: Path) -> None:
    def several(who: int) -> None:
        for number in range(8):
            annotate(recording, 1, number, f"{who} {number}")

    people = [threading.Thread(target=several, args=(who,)) for who in range(4)]
    for each in people:
        each.start()
    for each in people:
        each.join()
    found = read_annotations(recording.parent, 1)
    assert {mark.text for mark in found} == {f"{w} {n}" for w in range(4) for n in range(8)}
    assert len({mark.number for mark in found}) == 32


@pytest.mark.parametrize("dies_at", ["write", "rename"])
def test_a_kill_while_a_mark_is_made_leaves_all_before_and_the_next_one_is_kept(
    recording: Path, monkeypatch: pytest.MonkeyPatch, dies_at: str
) -> None:
    class Killed(BaseException):
        """What no handler of errors takes for one."""

    def die(*_: object) -> None:
        raise Killed

    annotate(recording, 1, 1.0, "before")
    with monkeypatch.context() as patched:
        if dies_at == "write":
            patched.setattr(atomic.os, "fsync", die)
        else:
            patched.setattr(Path, "replace", die)
        with pytest.raises(Killed):
            annotate(recording, 1, 2.0, "lost")
    assert [mark.text for mark in read_annotations(recording.parent, 1)] == ["before"]
    annotate(recording, 1, 3.0, "after")
    assert [m.text for m in read_annotations(recording.parent, 1)] == ["before", "after"]


@pytest.mark.parametrize(
    ("words", "until", "why"),
    [
        ("  ", None, "an annotation cannot be empty"),
        ("x" * 4001, None, r"has 4001 characters; the maximum is 4000"),
        ("back\u202ewards", None, r"contains the character U\+202E"),
        ("early", 1.0, "cannot last from 2 to 1 s"),
        ("never", float("nan"), "cannot last from 2 to nan s"),
    ],
)
def test_what_is_no_mark_is_refused_with_why(
    recording: Path, words: str, until: float | None, why: str
) -> None:
    with pytest.raises(RecordingError, match=why):
        annotate(recording, 1, 2.0, words, until)
    assert not annotations_path(recording.parent, 1).exists()


@pytest.mark.parametrize(
    "line",
    ["{", "[1]", '{"time": 1}', '{"withdraws": 7, "written": ""}',
     '{"time": NaN, "until": 1, "text": "", "written": ""}'],
)  # fmt: skip
def test_a_line_that_is_no_mark_is_named_and_nothing_is_added_to_such_a_file(
    recording: Path, line: str
) -> None:
    annotate(recording, 1, 1.0, "good")
    path = annotations_path(recording.parent, 1)
    path.write_text(path.read_text("utf-8") + line + "\n", "utf-8")
    before = path.read_bytes()
    for work in (
        lambda: read_annotations(recording.parent, 1),
        lambda: annotate(recording, 1, 2.0, "more"),
    ):
        with pytest.raises(
            RecordingError, match=r"annotations\.jsonl, line 2 is not an annotation: .*; corr"
        ):
            work()
    assert path.read_bytes() == before


def test_a_copy_and_a_link_get_no_marks_because_no_erasure_would_find_them(
    recording: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "desk" / "P001.h5"
    copy.parent.mkdir()
    copy.write_bytes(recording.read_bytes())
    with pytest.raises(
        RecordingError, match=r"is not in its place, P001/P001\.h5 in a data folder"
    ):
        annotate(copy, 1, 1.0, "lost")
    need("links")
    other = tmp_path / "other" / "P001"
    other.parent.mkdir()
    other.symlink_to(recording.parent, target_is_directory=True)
    with pytest.raises(RecordingError, match="is a link, and erasing never follows links"):
        annotate(other / "P001.h5", 1, 1.0, "lost")
    assert [path.name for path in copy.parent.iterdir()] == ["P001.h5"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no owners of this kind")
def test_somebody_elses_folder_and_one_that_can_only_be_read_get_no_marks(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    owner = os.geteuid()
    with monkeypatch.context() as patched:
        patched.setattr(os, "geteuid", lambda: owner + 1)
        with pytest.raises(RecordingError, match=rf"belongs to another user \({owner}\)"):
            annotate(recording, 1, 1.0, "mine")
    with monkeypatch.context() as patched:
        # The system's own answer, which it gives nobody who may do everything.
        patched.setattr(os, "access", lambda *_: False)
        with pytest.raises(
            RecordingError, match="is read-only, so annotations cannot be saved there"
        ):
            annotate(recording, 1, 1.0, "mine")
    if owner != 0:
        recording.parent.chmod(0o500)
        try:
            with pytest.raises(RecordingError, match="is read-only"):
                annotate(recording, 1, 1.0, "mine")
        finally:
            recording.parent.chmod(0o700)
    assert sorted(path.name for path in recording.parent.iterdir()) == ["P001.h5", "ses-01_run.xdf"]
