"""Which streams a request means."""

import pylsl
import pytest

from labcrane import StreamError
from labcrane.streams.request import NOBODY, StreamRequest, identity, unstable_id


def info(name="ActiChamp-0", kind="EEG", source_id="amp-1"):
    return pylsl.StreamInfo(name, kind, 32, 500.0, "float32", source_id)


@pytest.mark.parametrize(
    ("asked", "offered", "meant"),
    [
        ({"type": "EEG"}, info(), True),
        ({"type": "EEG"}, info(kind="Gaze"), False),
        ({"name": "ActiChamp-0"}, info(), True),
        ({"type": "EEG", "name": "other"}, info(), False),
        ({"source_id": "amp-1"}, info(), True),
        ({"source_id": "amp-2"}, info(), False),
        ({"type": "Markers"}, info(kind="Event"), True),
        ({"type": "Markers"}, info("labcrane.markers", "Markers"), False),
        ({"name": "labcrane.markers"}, info("labcrane.markers", "Markers"), True),
    ],
)
def test_a_stream_is_meant_when_all_that_is_asked_for_fits(asked, offered, meant):
    assert StreamRequest("a stream", **asked).matches(offered) is meant


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"type": "EEG"}, True),
        ({"type": "EEG", "several": True}, False),
        ({"type": "EEG", "name": "ActiChamp-0"}, False),
        ({"source_id": "amp-1"}, False),
    ],
)
def test_what_is_asked_for_by_type_alone_is_asked_about_and_said(asked, said):
    request = StreamRequest("eeg", **asked)
    assert request.asks is said
    text = request.taken("ActiChamp-0", "amp-1", "next-door")
    assert bool(text) is said
    if text:
        assert text == (
            "is requested by type 'EEG' only, and was confirmed: it is 'ActiChamp-0' (source_id "
            "'amp-1') of next-door"
        )


def test_a_confirmed_request_means_that_stream_alone_also_when_its_program_starts_again():
    def asked(*confirmed):
        return StreamRequest.of({"label": "eeg", "type": "EEG", "confirmed": list(confirmed)})

    mine = asked("amp-1", "ActiChamp-0", "EEG")
    assert not mine.asks
    assert mine.matches(info())
    assert not mine.matches(info(source_id="amp-2"))
    assert not mine.matches(info(name="filtered"))
    nameless = asked(*identity(info(source_id="")))
    assert nameless.matches(info(source_id=""))
    assert nameless.matches(info(source_id="-1856742883652690083"))  # of pylsl, another each time
    assert not nameless.matches(info())
    assert not StreamRequest("eeg", type="EEG", confirmed=NOBODY).matches(info())


def test_what_is_expected_is_compared_with_what_there_is():
    request = StreamRequest("EEG", type="EEG", rate_hz=1000.0, channels=64)
    assert request.misfits(64, 1000.0) == []
    assert len(request.misfits(32, 500.0)) == 2


def test_ids_that_change_with_every_start_are_told():
    assert unstable_id("amp-1") is None
    assert "no source_id" in unstable_id("")
    own = pylsl.StreamInfo("a", "b", 1, 0.0, "float32").source_id()
    assert "made up" in unstable_id(own)


def test_a_misspelt_request_says_what_it_may_hold():
    with pytest.raises(StreamError, match="no chanels; it has label, type"):
        StreamRequest.of({"label": "EEG", "type": "EEG", "chanels": 64})
