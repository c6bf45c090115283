"""Streams in words, a few lines each, that fit a terminal of 80 columns."""

from collections.abc import Iterator, Sequence
from textwrap import wrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from labcrane.core.signals import SignalFault
    from labcrane.monitoring.stream_meter import StreamReading
    from labcrane.monitoring.watch import StreamView

WIDTH = 80
MOST_LABELS = 6
SILENT_S = 1.0


def watched_lines(view: "StreamView", width: int = WIDTH) -> Iterator[str]:
    """Yield a stream's reception, and whether its signal is alive."""
    stream, reading = view.stream, view.reading
    if stream is None:
        yield f"{view.name}: on {view.host}"
    else:
        units = tuple(dict.fromkeys(each.unit for each in stream.channels if each.unit))
        yield f"{view.name}: {_head(stream.type, stream.rate_hz, len(stream.channels), units)}"
    yield from _wrapped("clock   ", _clock(reading), width)
    yield from _wrapped("flow    ", _flow(reading), width)
    for line in _signal(view):
        yield from _wrapped("signal  ", line, width)
    for line in view.trouble:
        yield from _wrapped("trouble ", line, width)


def _head(kind: str, rate_hz: float, channels: int, units: Sequence[str]) -> str:
    rate = f"at {rate_hz:g} Hz" if rate_hz else "irregular"
    count = f"{channels} channel{'s' if channels != 1 else ''}"
    return f"{kind or 'no type'}, {count} {rate}" + (f", in {', '.join(units)}" if units else "")


def _clock(reading: "StreamReading") -> str:
    if reading.offset is None or reading.rtt is None:
        return "unknown so far: UDP must pass the firewall"
    skew = "" if reading.skew_ppm is None else f", {reading.skew_ppm:+.1f} ppm"
    return f"{reading.offset:+.6f} s{skew}, round trip {1e3 * reading.rtt:.2f} ms"


def _flow(reading: "StreamReading") -> str:
    if reading.samples == 0:
        return "no sample yet: start the device's acquisition"
    parts = [f"{reading.samples} samples"]
    if reading.rate_hz is not None:
        parts.append(f"{reading.rate_hz:.2f} Hz")
    if reading.chunk is not None and reading.largest_chunk is not None:
        parts.append(f"{reading.chunk} at once, {reading.largest_chunk} at most")
    if reading.jitter is not None:
        parts.append(f"jitter {1e3 * reading.jitter:.2f} ms")
    if reading.delay is not None and reading.largest_delay is not None:
        late = f"{1e3 * reading.delay:.0f} to {1e3 * reading.largest_delay:.0f} ms"
        parts.append(f"here {late} after their timestamps")
    if reading.gaps:
        parts.append(f"{reading.gaps} gaps, the longest {reading.longest_gap:.3f} s")
    if reading.missing is not None:
        parts.append(f"{reading.missing} lost by its counter")
    if reading.disorder:
        parts.append(f"{reading.disorder} timestamps out of order")
    if reading.silent is not None and reading.silent > SILENT_S and reading.rate_hz is not None:
        parts.append(f"silent for {reading.silent:.0f} s")
    return ", ".join(parts)


def _signal(view: "StreamView") -> Iterator[str]:
    """Yield the faults, with channels of the same fault together."""
    if not view.watched:
        if view.stream is not None:
            yield "no monitor knows this stream"
        return
    if not view.faults:
        yield "alive" if view.reading.samples else "-"
        return
    kinds: dict[str, list[SignalFault]] = {}
    for fault in view.faults:
        kinds.setdefault(fault.kind, []).append(fault)
    for kind, faults in kinds.items():
        named = [fault.channel for fault in faults if fault.channel]
        more = f" and {len(named) - MOST_LABELS} more" if len(named) > MOST_LABELS else ""
        where = f"{', '.join(named[:MOST_LABELS])}{more}: " if named else ""
        alike = len({fault.message for fault in faults}) == 1
        whose = "" if alike else f"{faults[0].channel} "
        yield f"{where}{kind.upper()}: {whose}{faults[0].message}"


def _wrapped(begin: str, text: str, width: int = WIDTH) -> list[str]:
    inner = " " * (2 + len(begin))
    return wrap(
        text,
        width,
        initial_indent=f"  {begin}",
        subsequent_indent=inner,
        break_long_words=False,
        break_on_hyphens=False,
    )
