import json
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from labcrane import PluginError, RecordingError
from labcrane.core import Event
from labcrane.recording import Channel, StreamHeader, XdfWriter
from labcrane.recording.journal import Column, SessionJournal, event_text
from labcrane.recording.journal_reader import UNREADABLE, read_journal


class Colour(StrEnum):
    RED = "red"


@pytest.mark.parametrize(
    ("value", "held"),
    [
        (float("nan"), None),
        (float("inf"), None),
        (np.float64(2.5), 2.5),
        (np.float32("nan"), None),
        (np.int64(3), 3),
        (np.bool_(True), True),  # noqa: FBT003
        (np.array([1.0, np.nan]), [1.0, None]),
        (Colour.RED, "red"),
        (MappingProxyType({"a": (1, float("nan"))}), {"a": [1, None]}),
        ("zażółć\0\n", "zażółć\0\n"),
        ("\udc80", "\udc80"),
        (None, None),
        (2**70, 2**70),
    ],
)
def test_event_data_becomes_json(value: Any, held: Any) -> None:
    text = event_text(Event("a.b", 1.0, {"x": value}), 7)
    assert json.loads(text) == {"event": "a.b", "tick": 7, "x": held}
    text.encode()


def test_event_data_that_is_no_json_is_the_plugins_fault() -> None:
    with pytest.raises(PluginError, match=r"'a.b' cannot be recorded: object is not a number"):
        event_text(Event("a.b", 1.0, {"x": object()}), 0)  # type: ignore[dict-item]


def test_event_data_may_not_hide_name_and_tick() -> None:
    with pytest.raises(PluginError, match="data called tick"):
        event_text(Event("a.b", 1.0, {"tick": 3}), 0)


@pytest.mark.parametrize(
    ("columns", "problem"),
    [
        ([Column("eeg", "x", "V")], "the groups are loop, input"),
        ([Column("state", "a b", "1")], "not a dotted path"),
        ([Column("state", "a", "1"), Column("state", "a", "m")], "appears twice"),
        ([Column("state", "a", "1"), Column("state", "a.b", "m")], "cannot be below"),
    ],
)
def test_columns_that_would_collide_in_the_participant_file_are_refused(
    tmp_path: Path, columns: list[Column], problem: str
) -> None:
    with pytest.raises(RecordingError, match=problem):
        SessionJournal(tmp_path / "x.xdf", columns, 240.0)
    assert not (tmp_path / "x.xdf").exists()


def test_an_event_whose_text_is_no_json_is_kept_as_text(tmp_path: Path) -> None:
    path = tmp_path / "x.xdf"
    with XdfWriter(path) as writer:
        header = StreamHeader("labcrane.events", "Markers", (Channel("event"),), "string")
        number = writer.add_stream(header)
        writer.write_texts(number, [1.0, 2.0], [["{"], ["[1]"]])
    log, _ = read_journal([path])
    assert [(event.name, event.data["text"]) for event in log.events] == [
        (UNREADABLE, "{"),
        (UNREADABLE, "[1]"),
    ]
