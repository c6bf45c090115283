"""Discovery of the streams on the network."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from labcrane.errors import RecordingError
from labcrane.recording.xdf.header import StreamHeader
from labcrane.streams.known_programs import KnownProgram, program_of
from labcrane.streams.probes import ClockProbe, Probe
from labcrane.streams.request import unstable_id
from labcrane.streams.search import find

if TYPE_CHECKING:
    import pylsl

ANSWER_S = 2.0
MOST = 1024
"""More streams than liblsl reports."""


@dataclass(frozen=True, slots=True)
class FoundStream:
    """A stream as it is offered.

    Attributes
    ----------
    rate_hz
        Nominal; 0 when irregular.
    units
        Of its channels, each once, in order; empty when it states none.
    offset_s, rtt_s
        What must be added to its clock to have ours, and the round trip of that measurement; None
        when it does not answer.
    warnings
        What will make it hard to record.
    program
        The program that sends it, where its header shows that.
    """

    name: str
    type: str
    source_id: str
    host: str
    uid: str
    format: str
    channels: int
    rate_hz: float
    units: tuple[str, ...]
    offset_s: float | None
    rtt_s: float | None
    warnings: tuple[str, ...]
    program: KnownProgram | None = None


def discover(wait_s: float = 1.5) -> list[FoundStream]:
    """Return the streams that answer within ``wait_s``, by name and host."""
    infos = find("", wait_s, minimum=MOST)
    with ThreadPoolExecutor(max_workers=max(len(infos), 1)) as pool:
        found = list(pool.map(_describe, infos))
    return sorted(_with_duplicates(found), key=lambda one: (one.name, one.host, one.uid))


def _describe(info: "pylsl.StreamInfo") -> FoundStream:
    import pylsl  # noqa: PLC0415

    inlet = pylsl.StreamInlet(info, recover=False, processing_flags=0)
    header = _header(inlet)
    probe = ClockProbe(inlet).new(ANSWER_S)
    return FoundStream(
        name=info.name(),
        type=info.type(),
        source_id=info.source_id(),
        host=info.hostname(),
        uid=info.uid(),
        format="" if header is None else header.format,
        channels=info.channel_count(),
        rate_hz=info.nominal_srate(),
        units=_units(header),
        offset_s=None if probe is None else probe.offset,
        rtt_s=None if probe is None else probe.rtt,
        warnings=tuple(_warnings(info, header, probe)),
        program=None if header is None else program_of(header),
    )


def _units(header: StreamHeader | None) -> tuple[str, ...]:
    channels = () if header is None else header.channels
    return tuple(dict.fromkeys(channel.unit for channel in channels if channel.unit))


def _header(inlet: "pylsl.StreamInlet") -> StreamHeader | None:
    try:
        return StreamHeader.from_xml(inlet.info(timeout=ANSWER_S).as_xml())
    except (TimeoutError, RuntimeError, RecordingError):  # RuntimeError: pylsl's LostError
        return None


def _warnings(
    info: "pylsl.StreamInfo", header: StreamHeader | None, probe: Probe | None
) -> list[str]:
    found = []
    if header is None:
        found.append("does not send its description: check that TCP passes the firewall")
    if probe is None:
        found.append("does not answer clock probes: check that UDP passes the firewall")
    if (unstable := unstable_id(info.source_id())) is not None:
        found.append(unstable)
    return found


def _with_duplicates(found: list[FoundStream]) -> list[FoundStream]:
    counts: dict[tuple[str, str, str], int] = {}
    for one in found:
        key = one.source_id, one.name, one.type
        counts[key] = counts.get(key, 0) + 1
    return [_warned(one, counts[one.source_id, one.name, one.type]) for one in found]


def _warned(one: FoundStream, alike: int) -> FoundStream:
    if not one.source_id or alike == 1:
        return one
    text = f"is sent by {alike} programs under one source_id: stop all but one"
    return replace(one, warnings=(*one.warnings, text))
