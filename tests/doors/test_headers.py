"""Headers of streams: as large, deep and wide as the table of limits says, and no more."""

import re

import pytest

from labcrane import RecordingError
from labcrane.limits import LIMITS
from labcrane.recording import StreamHeader

MOST, DEEPEST = LIMITS["stream header"].most, LIMITS["stream header"].depth
CHANNELS = LIMITS["stream channels"].most


def header(
    count: object = 2, rate: object = 500, form: str = "float32", desc: str = "", more: str = ""
) -> str:
    return (
        f'<?xml version="1.0"?>{more}<info><name>EEG</name><type>EEG</type>'
        f"<channel_count>{count}</channel_count><nominal_srate>{rate}</nominal_srate>"
        f"<channel_format>{form}</channel_format><desc>{desc}</desc></info>"
    )


def nested(depth: int) -> str:
    return "<a>" * depth + "</a>" * depth


def long(size: int) -> str:
    return header(desc="x" * (size - len(header())))


@pytest.mark.parametrize(
    "text", [header(), header(CHANNELS), header(desc=nested(DEEPEST - 2)), long(MOST)]
)
def test_a_header_may_be_as_large_as_the_table_says(text: str) -> None:
    assert StreamHeader.from_xml(text).name == "EEG"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (long(MOST + 1), f"it has {MOST + 1} characters; the maximum is {MOST}"),
        (
            header(CHANNELS + 1),
            f"stream 'EEG' has {CHANNELS + 1} channels; the maximum is {CHANNELS}",
        ),
        (header(10**12), "stream 'EEG' has 1000000000000 channels"),
        (header("9" * 5000), "a stream header cannot be read"),
        (header(0), "stream 'EEG' has no channel"),
        (header(-3), "stream 'EEG' has no channel"),
        (header("two"), "a stream header cannot be read"),
        (header(rate="nan"), "its rate is nan Hz"),
        (header(rate="1e999"), "its rate is inf Hz"),
        (header(rate=-1), "its rate is -1.0 Hz"),
        (header(form="complex"), "has the channel format 'complex'; XDF knows"),
        (header(desc=nested(DEEPEST)), "its elements are nested too deep"),
        (header(desc=nested(100_000)), "its elements are nested too deep"),
        (header(more='<!DOCTYPE a [<!ENTITY b "bb">]>'), "a document type or entities"),
        ("<info><name>EEG</name>", "a stream header cannot be read"),
        ("", "a stream header cannot be read"),
    ],
)
def test_a_header_beyond_the_table_is_refused_in_words(text: str, why: str) -> None:
    with pytest.raises(RecordingError, match=re.escape(why)):
        StreamHeader.from_xml(text)
