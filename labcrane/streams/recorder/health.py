"""Health of streams: what has come of each, and how it flows now."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from labcrane.recording.pictures import LOG, RATE_S
from labcrane.recording.xdf.header import StreamHeader
from labcrane.streams.probes import FASTER, Probe

COUNTERS = frozenset({"counter", "samplecounter", "packetcounter", "framenumber"})

SILENT_S = 1.0
OFFSET_AGE_S = 6.0
RATE_TOLERANCE = 0.05
RTT_S = 0.02
WINDOW_S = 5.0


@dataclass
class Flow:
    """What has come so far; read by the watchdog while the inlet's threads write it.

    Times are ours, in seconds; ``last`` is NaN before the first sample.
    """

    samples: int = 0
    last: float = float("nan")
    arrivals: list[tuple[float, int]] = field(default_factory=list)
    probe: Probe | None = None
    probes: int = 0
    resets: int = 0
    missing: int = 0
    fault: str | None = None
    warnings: list[str] = field(default_factory=list)
    """What is not as it was of a source that came back."""

    def came(self, time: float, count: int) -> None:
        """Count samples that arrived, and keep the last ten seconds of it."""
        self.samples += count
        self.last = time
        self.arrivals = [(t, n) for t, n in self.arrivals if t > time - 10.0]
        self.arrivals.append((time, self.samples))


class Condition(StrEnum):
    """How a stream is."""

    ABSENT = "absent"
    ASKED = "asked about"  # one fits by its type only, and is not confirmed
    OPENING = "opening"
    EMPTY = "empty"  # found, but no sample came yet
    FLOWS = "flows"
    SILENT = "silent"


@dataclass(frozen=True, slots=True)
class Health:
    """How one stream is, ready for JSON. Times in seconds; None where it is not known."""

    label: str
    name: str
    type: str
    source_id: str
    host: str
    required: bool
    condition: Condition
    samples: int
    rate_hz: float | None
    nominal_hz: float
    channels: int
    silent_s: float | None
    offset_s: float | None
    offset_age_s: float | None
    rtt_s: float | None
    missing: int
    resets: int
    misfits: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    signals: list[Mapping[str, str]] = field(default_factory=list)
    """What is wrong with its signal now: channel, kind and message of each fault."""

    unwatched: Mapping[str, str] = field(default_factory=dict)
    """Why a monitor does not look at it any more, by its name."""

    taken: str = ""
    """Which stream it is, where any of its type would have fitted."""

    candidates: list[Mapping[str, Any]] = field(default_factory=list)
    """Which streams may be the one that is meant, as of
    :class:`labcrane.streams.recorder.candidates.Candidate`."""

    @property
    def sane(self) -> bool:
        """Whether it is what was expected, flows as far as can be said, and its clock is known."""
        flows = self.condition is Condition.FLOWS or (
            self.nominal_hz == 0.0 and self.condition is Condition.EMPTY
        )
        known = self.offset_age_s is not None and self.offset_age_s < OFFSET_AGE_S
        return flows and known and not self.misfits

    def as_json(self) -> dict[str, Any]:
        """Return what JSON can hold."""
        return asdict(self) | {"sane": self.sane}


def rate(flow: "Flow", now: float) -> float | None:
    """Return samples per second over the last seconds; None before there are two chunks."""
    recent = [(t, n) for t, n in list(flow.arrivals) if t > now - WINDOW_S]
    if len(recent) < 2:  # noqa: PLR2004
        return None
    (first, before), (last, after) = recent[0], recent[-1]
    return (after - before) / (last - first) if last > first else None


def picture_rate(flow: "Flow", now: float) -> float | None:
    """Return pictures a second over the last ``RATE_S``; None before they came for so long."""
    arrivals = list(flow.arrivals)
    before = [count for time, count in arrivals if time <= now - RATE_S]
    return (arrivals[-1][1] - before[-1]) / RATE_S if before else None


def rate_of(name: str, flow: "Flow", now: float) -> float | None:
    """Return the rate of the stream ``name``: that of pictures if it is a view's log."""
    return (picture_rate if name.startswith(LOG) else rate)(flow, now)


def condition(flow: "Flow", header: StreamHeader | None, now: float) -> Condition:
    """Return how a stream is. Irregular streams are never silent: nothing may have happened."""
    if header is None:
        return Condition.OPENING
    if flow.samples == 0:
        return Condition.EMPTY
    patience = max(SILENT_S, 5.0 / header.rate_hz) if header.rate_hz > 0 else math.inf
    return Condition.SILENT if now - flow.last > patience else Condition.FLOWS


def complaints(health: Health) -> list[str]:
    """Say what is wrong with a stream at this moment."""
    found = []
    if health.condition is Condition.SILENT:
        found.append(f"is silent for {health.silent_s:.1f} s: check the device and its program")
    if health.condition is Condition.EMPTY and health.nominal_hz > 0:
        found.append("has sent no sample: start the device's acquisition")
    if health.condition is Condition.FLOWS and health.nominal_hz > 0 and health.rate_hz is not None:
        off = health.rate_hz / health.nominal_hz - 1.0
        if abs(off) > RATE_TOLERANCE:
            found.append(
                f"runs at {health.rate_hz:.1f} Hz instead of {health.nominal_hz:g} Hz: "
                "samples are lost, or its header is wrong"
            )
    if health.offset_age_s is not None and health.offset_age_s > OFFSET_AGE_S:
        found.append(
            f"has not answered a clock probe for {health.offset_age_s:.0f} s: check the network, "
            "and that UDP passes the firewall"
        )
    if health.rtt_s is not None and health.rtt_s > RTT_S:
        found.append(f"answers clock probes in {1e3 * health.rtt_s:.1f} ms: {FASTER}")
    if health.missing:
        found.append(f"has lost {health.missing} samples by its own counter")
    return found


class Counter:
    """A channel that counts samples; tells how many are missing."""

    def __init__(self, column: int) -> None:
        self._column = column
        self._last: float | None = None

    @classmethod
    def of(cls, header: StreamHeader, label: str | None) -> "Counter | None":
        """Return the counter of a stream of numbers, by its label or its usual names."""
        counting = counter_label(header, label)
        return None if counting is None else cls(header.labels.index(counting))

    def forget(self) -> None:
        """Reset: the source is another process."""
        self._last = None

    def missing(self, data: npt.NDArray[Any]) -> int:
        """Return how many samples the counter left out; a wrap to a lower number is not a gap."""
        counts = np.asarray(data[:, self._column], dtype=np.float64)
        if self._last is not None:
            counts = np.r_[self._last, counts]
        self._last = float(counts[-1])
        steps = np.diff(counts)
        return int(np.sum(steps[steps > 1.0] - 1.0))


def counter_label(header: StreamHeader, label: str | None) -> str | None:
    """Return the label of the channel that counts samples, by its name or the usual ones."""
    if header.dtype is None:
        return None
    for channel in header.channels:
        usual = {_word(channel.label), _word(channel.type)} & COUNTERS
        if channel.label == label or (label is None and usual):
            return channel.label
    return None


def _word(text: str) -> str:
    return "".join(letter for letter in text.lower() if letter.isalpha())
