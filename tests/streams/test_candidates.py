"""Streams that only their type asks for: whoever runs the session says which one is meant."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest
from faults.sessions import wait_for
from streams.emulation import Lab

from labcrane import StreamError
from labcrane.recording.foreign_streams import read_streams
from labcrane.recording.paths import parts
from labcrane.streams.recorder.candidates import Candidate, answered, question
from labcrane.streams.recorder.handle import RecorderHandle
from labcrane.streams.request import NOBODY, StreamRequest
from labcrane.streams.sync.report.limits import Limits
from labcrane.streams.sync.report.stream_report import judge_stream
from labcrane.streams.sync.report.sync_report import SyncReport
from labcrane.streams.sync.resync import resync

MINE = Candidate(("amp-1", "ActiChamp", "EEG"), "lab-pc")
HIS = Candidate(("amp-2", "LiveAmp", "EEG"), "next-door")
DERIVED = Candidate(("amp-1", "Filtered", "EEG"), "lab-pc")
NAMELESS = Candidate(("", "Unicorn", "EEG"), "lab-pc")


def status(*candidates: Candidate, required: bool = True) -> list[dict[str, object]]:
    """Return how streams are, as it comes from a recorder."""
    found = [asdict(one) for one in candidates]
    eeg = {"label": "eeg", "required": required, "candidates": found}
    return json.loads(json.dumps([eeg, {"label": "gaze", "required": True, "candidates": []}]))


@pytest.mark.parametrize(
    ("said", "there", "meant"),
    [
        ("eeg", (MINE,), MINE),
        ("eeg=amp-1", (MINE, HIS), MINE),
        (" eeg = LiveAmp ", (MINE, HIS), HIS),
        ("eeg=Filtered", (MINE, DERIVED), DERIVED),
        ("eeg=Unicorn", (MINE, NAMELESS), NAMELESS),
        ("eeg=amp-1", (MINE, Candidate(MINE.identity, "a-twin")), MINE),
    ],
)
def test_an_answer_means_one_stream(
    said: str, there: tuple[Candidate, ...], meant: Candidate
) -> None:
    assert answered(said, status(*there)) == ("eeg", meant.identity)


@pytest.mark.parametrize(
    ("said", "there", "why"),
    [
        ("eeg", (MINE, HIS), "2 streams for 'eeg' are called ''"),
        ("eeg=amp-1", (MINE, DERIVED), "2 streams for 'eeg' are called 'amp-1'"),
        ("eeg=amp-3", (MINE, HIS), "0 streams .*: 'ActiChamp' .source_id 'amp-1'. of lab-pc; 'Li"),
        ("gaze", (MINE,), "stream 'gaze' needs no confirmation; these do: eeg"),
        ("", (MINE,), "stream '' needs no confirmation; these do: eeg"),
        ("eeg", (), "stream 'eeg' needs no confirmation; no stream needs confirmation"),
        ("eeg=none", (MINE,), "stream 'eeg' is required and cannot be left out"),
    ],
)
def test_an_answer_that_means_none_or_two_says_what_there_is(
    said: str, there: tuple[Candidate, ...], why: str
) -> None:
    with pytest.raises(StreamError, match=why):
        answered(said, status(*there))


def test_what_is_not_required_can_be_left_out() -> None:
    assert answered("eeg=none", status(MINE, HIS, required=False)) == ("eeg", NOBODY)


def test_the_question_names_who_may_be_meant_and_how_to_answer() -> None:
    one = question("eeg", "EEG", [MINE], required=True)
    assert "Record 'ActiChamp' (source_id 'amp-1') of lab-pc? Enter take eeg. To avoid" in one
    two = question("eeg", "EEG", [MINE, NAMELESS], required=False)
    assert "of lab-pc; or 'Unicorn' (no persistent source_id) of lab-pc?" in two
    assert "Enter take eeg=SOURCE_ID (or its name), or take eeg=none to leave it out" in two


@pytest.fixture
def lab(tmp_path: Path):
    lab = Lab(tmp_path, Path("not needed"))
    yield lab
    lab.close()


@pytest.mark.slow
def test_nothing_of_a_stream_is_recorded_before_it_is_confirmed_and_it_is_asked_once(
    lab: Lab,
) -> None:
    lab.sender("Amplifier", "AskedEEG", "amplifier-1")
    lab.sender("Neighbour", "AskedEEG", "amplifier-2")
    wanted = [
        StreamRequest("eeg", type="AskedEEG"),
        StreamRequest("more", type="AskedEEG", required=False),
    ]
    handle = RecorderHandle(lab.journal, wanted)

    def watched(label: str) -> dict[str, object]:
        handle.watch()
        return next((one for one in handle.status.get("streams", ()) if one["label"] == label), {})

    try:
        wait_for(lambda: len(watched("eeg").get("candidates", ())) == 2)
        assert not handle.ready
        assert watched("eeg")["condition"] == "asked about"
        assert "'Neighbour' (source_id 'amplifier-2')" in watched("eeg")["warnings"][0]
        assert lab.streams() == {}  # nobody has said that either of them may be
        with pytest.raises(StreamError, match="2 streams for 'eeg'"):
            handle.confirm("eeg")
        said = handle.confirm("eeg=amplifier-1")
        assert said == ("eeg", "'Amplifier' (source_id 'amplifier-1')")
        wait_for(lambda: watched("eeg").get("condition") == "flows")
        wait_for(lambda: len(watched("more").get("candidates", ())) == 1)
        assert handle.confirm("more=none") == ("more", "none of them")
        wait_for(lambda: "was left out" in watched("more")["warnings"][0])
        for recorder in handle._recorders:  # those that take over know what was answered
            recorder.kill()
        wait_for(lambda: handle.watch() or handle.restarts == 2)
        wait_for(lambda: handle.ready and watched("eeg").get("condition") == "flows")
        assert not handle.asks
    finally:
        handle.stop()
    found, _ = read_streams(parts(lab.journal))
    (one,) = [stream for stream in found if stream.header.type == "AskedEEG"]
    assert one.header.name == "Amplifier"
    report = SyncReport((judge_stream(one, resync(one).quality, Limits()),))
    was = "is requested by type 'AskedEEG' only, and was confirmed: it is 'Amplifier'"
    assert any(was in line for line in report.details())
    assert not any(", and was confirmed" in line for line in report.advice())


@pytest.mark.slow
def test_who_names_a_stream_has_it_before_who_would_have_any_of_its_type(lab: Lab) -> None:
    lab.sender("Amplifier", "NamedEEG", "amplifier-1")
    wanted = [
        StreamRequest("any", type="NamedEEG", required=False),
        StreamRequest("mine", source_id="amplifier-1"),
    ]
    handle = RecorderHandle(lab.journal, wanted)
    try:
        wait_for(lambda: handle.watch() or handle.ready)
        assert not handle.asks
    finally:
        handle.stop()
