"""Journals whose events say something else than ours: read, or refused in words."""

import random
from pathlib import Path

import pytest
from recording.journals import COLUMNS, CONTEXT, frames, stamp

from labcrane import LabcraneError
from labcrane.core import Event
from labcrane.recording.journal import SessionJournal
from labcrane.recording.participant_file.writer import consolidate
from labcrane.session.resume import progress

NAMES = (
    "trial.start", "trial.end", "step.start", "step.end", "session.resumed", "session.end",
    "session.failed", "questionnaire.answer", "questionnaire.end", "order.completion", "order.end",
    "stop_rule.met", "pause.end",
)  # fmt: skip
KEYS = (
    "trial", "attempt", "counted", "outcome", "step", "done", "owed", "reason", "why", "void",
    "questionnaire", "item", "value", "text", "after", "refused", "by",
)  # fmt: skip
VALUES = (
    None, True, -1, 0, 1, 2, 2**70, 1e308, float("nan"), "", "a\0b", "success", "1-3", "9" * 5000,
    "../../x", [], [[]], {}, {"a": 1},
)  # fmt: skip


def hostile(path: Path, dice: random.Random) -> Path:
    with SessionJournal(path, COLUMNS, 240.0) as journal:
        journal.write_event(Event("session.start", stamp(0), CONTEXT), 0)
        for number in range(10):
            journal.write_frame(stamp(number), frames(1, number)[0])
            said = {dice.choice(KEYS): dice.choice(VALUES) for _ in range(dice.randrange(6))}
            journal.write_event(Event(dice.choice(NAMES), stamp(number), said), number)
    return path


@pytest.mark.parametrize("seed", range(60))
def test_an_event_that_is_none_of_ours_is_read_or_named(tmp_path: Path, seed: int) -> None:
    (tmp_path / "P001").mkdir()
    journal = hostile(tmp_path / "P001" / "ses-01_run.xdf", random.Random(seed))
    for what in (
        lambda: progress(journal, ["slew"]),
        lambda: consolidate(tmp_path / "P001" / "P001.h5", [journal]),
    ):
        try:
            what()
        except LabcraneError as error:
            assert str(tmp_path) in str(error)  # noqa: PT017 - some are harmless


def test_what_an_event_does_not_say_is_told_with_its_time(tmp_path: Path) -> None:
    journal = tmp_path / "ses-01_run.xdf"
    with SessionJournal(journal, COLUMNS, 240.0) as writer:
        writer.write_event(Event("session.start", stamp(0), CONTEXT), 0)
        writer.write_event(Event("session.end", stamp(240), {}), 240)
    said = (
        r"ses-01_run\.xdf: event 'session\.end' at 1001\.000 s lacks a value that it "
        r"needs \(KeyError\('reason'\)\), so the remaining trials are unknown; use labcrane recover"
    )
    with pytest.raises(LabcraneError, match=said):
        progress(journal, ["slew"])
