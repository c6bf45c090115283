"""Programs that send a device's samples by LSL, and how they stamp them.

Each row was read in the program's source text, and none was tried with its device.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from labcrane.recording.xdf.header import Description, StreamHeader


@dataclass(frozen=True)
class KnownProgram:
    """One program.

    Attributes
    ----------
    name
        Its repository.
    marks
        What its streams' headers begin with, by place: ``name``, ``source_id``, or a path below
        ``desc``.
    declared
        How a protocol declares its stream: keys and values.
    stamps
        How it stamps samples, in words.
    source
        The file of the repository in which that is.
    """

    name: str
    marks: Mapping[str, str]
    declared: Mapping[str, str]
    stamps: str
    source: str


SENT = {"stamped": "when_sent"}
A_CHUNK = "stamps a chunk with the time at which it read it"
A_SAMPLE = "stamps a sample with the time at which it sends it"

KNOWN = (
    KnownProgram(
        "App-BrainAmpSeries",
        {"name": "BrainAmpSeries-", "acquisition/manufacturer": "Brain Products"},
        SENT, A_CHUNK, "mainwindow.cpp",
    ),
    KnownProgram(
        "App-eegoSports",
        {"name": "eegoSports ", "acquisition/manufacturer": "antneuro"},
        SENT, A_CHUNK, "reader.cpp",
    ),
    KnownProgram(
        "App-EGIAmpServer",
        {"source_id": "EGI_", "acquisition/manufacturer": "Magstim EGI"},
        SENT, A_SAMPLE, "src/core/src/LSLStreamer.cpp",
    ),
    KnownProgram(
        "App-WearableSensing", {"manufacturer": "WearableSensing"}, SENT, A_SAMPLE, "CLI/dsi2lsl.c"
    ),
    KnownProgram(
        "OpenBCI_LSL", {"source_id": "openbci_eeg_id1"}, SENT, A_SAMPLE, "lib/streamerlsl.py"
    ),
    KnownProgram(
        "App-EyeLink",
        {"name": "EyeLink", "source_id": "eyelink-"},
        SENT, "stamps the newest sample with the time at which it asked for it", "eyelink.py",
    ),
    KnownProgram(
        "EyeLogic-LSL",
        {"name": "EyeLogic", "acquisition/manufacturer": "EyeLogic"},
        {"stamped": "at_sampling", "counter": "FrameNumber"},
        "stamps a sample with the time at which the tracker took it", "src/LSLClient.cpp",
    ),
)  # fmt: skip


def program_of(header: StreamHeader) -> KnownProgram | None:
    """Return the program that sends a stream, by the stream's header."""
    return next(
        (
            program
            for program in KNOWN
            if all(_at(header, place).startswith(mark) for place, mark in program.marks.items())
        ),
        None,
    )


def _at(header: StreamHeader, place: str) -> str:
    here: Description = {"name": header.name, "source_id": header.source_id, **header.desc}
    for step in place.split("/"):
        here = here.get(step, "") if isinstance(here, Mapping) else ""
    return here if isinstance(here, str) else ""
