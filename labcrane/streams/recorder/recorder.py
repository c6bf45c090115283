"""Recorder of the external streams: all that were requested, late or again after a restart."""

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.errors import RecordingError
from labcrane.recording.foreign_streams import OWN_CLOCK
from labcrane.recording.paths import next_part, part_path
from labcrane.recording.xdf.writer import XdfWriter
from labcrane.streams.recorder.absence import PATIENCE_S, FreePorts, absent, missed
from labcrane.streams.recorder.candidates import Candidate, question
from labcrane.streams.recorder.health import Condition, Health, complaints, condition, rate_of
from labcrane.streams.recorder.inlet import Inlet
from labcrane.streams.recorder.own_clock import read_own_clock
from labcrane.streams.recorder.signal_feed import SignalFeed
from labcrane.streams.request import NOBODY, Identity, StreamRequest, unstable_id
from labcrane.streams.search import Search, known_stream

if TYPE_CHECKING:
    import pylsl

FORGET_S = 3.0
"""A stream that has gone is listed for so long; only then is another one of its id a duplicate."""


_Key = tuple[str, str, str, int, int]
"""What liblsl knows a stream by when its program is started again: id, name, type and shape."""


@dataclass(frozen=True, slots=True)
class _Recorded:
    request: StreamRequest
    inlet: Inlet
    misfits: list[str]
    warnings: list[str]
    taken: str

    def warn(self, text: str) -> None:
        """Say from now on, and note once beside the stream, what is wrong with it."""
        if text not in self.warnings:
            self.warnings.append(text)
            self.inlet.note("warning", text=text)


class Recorder:
    """Records what is asked for as soon as it is there. Call ``look`` several times a second.

    A stream that is requested by type only waits until one candidate is confirmed.

    Parameters
    ----------
    journal
        The first part.
    requests
        What to record.
    part
        Which part is written, counted from 1; by default the first that there is not yet.
    known
        Descriptions of streams that another recorder has found: they are received at once.
    """

    def __init__(
        self,
        journal: Path,
        requests: Sequence[StreamRequest],
        part: int | None = None,
        known: Sequence[str] = (),
        monitors: Mapping[str, Any] | None = None,
    ) -> None:
        # Who names its stream comes before who would have any of its type.
        self._requests = tuple(sorted(requests, key=lambda one: one.by_type_alone))
        self._candidates: dict[str, list[Candidate]] = {}
        self._writer = XdfWriter(next_part(journal) if part is None else part_path(journal, part))
        self._streams: dict[_Key, _Recorded] = {}
        self._there: set[_Key] = set()
        self._since: dict[str, float] = {}
        self._rivalled: set[_Key] = set()
        self._fault: str | None = None
        self._feed = None if monitors is None else SignalFeed(monitors)
        self.know(known)
        self._own = self._writer.add_stream(OWN_CLOCK) if read_own_clock() is not None else None
        self._search = Search(forget_s=FORGET_S)
        self._began = time.monotonic()
        self._free_ports = FreePorts()

    @property
    def path(self) -> Path:
        """The part of the journal that is being written."""
        return self._writer.path

    def look(self) -> None:
        """Start to record what has appeared, and note how our own clock stands."""
        self._log_own_clock()
        found = [info for info in self._search.results() if self._wanted(info) is not None]
        now = time.monotonic()
        self._since = {info.uid(): self._since.get(info.uid(), now) for info in found}
        self._there = {_key(info) for info in found}
        self._candidates = {}
        for info in found:
            self._start(info)
        self._find_duplicates(found, now)
        self._leave_the_gone()
        self._note_returned()
        self._note_rivals()
        if self._feed is not None:
            self._feed.look()

    def know(self, descriptions: Sequence[str]) -> None:
        """Record streams on this computer from their descriptions, without a search."""
        for info in map(known_stream, descriptions):
            if info is not None:
                self._start(info)

    def confirm(self, label: str, meant: Identity) -> None:
        """Record this stream as the one of its type that is meant; NOBODY for none."""
        self._requests = tuple(
            replace(one, confirmed=meant) if one.label == label and one.asks else one
            for one in self._requests
        )
        self._candidates.pop(label, None)

    def health(self) -> list[Health]:
        """Return how each stream is now, also those asked for that are not there."""
        now = time.perf_counter()
        found = []
        for key, one in self._streams.items():
            health = _health(one, now, self._rivals(one))
            if (shape := self._shape_now(key)) is not None:  # what is required is the new one
                health = replace(health, required=False, warnings=[*health.warnings, shape])
            found.append(health)
        there = {one.request.label for one in self._streams.values()}
        return found + [self._absent(one) for one in self._requests if one.label not in there]

    def status(self) -> dict[str, Any]:
        """Return how the recording is, ready for JSON."""
        streams, recorded = self.health(), self._streams.values()
        faults = {self._fault, *(one.inlet.flow.fault for one in recorded)} - {None}
        return {
            "journal": str(self.path),
            "bytes": self._writer.size,
            "free": self._writer.free,
            "ready": all(one.sane for one in streams if one.required) and not faults,
            "faults": sorted(str(fault) for fault in faults),
            "streams": [one.as_json() for one in streams],
            "known": [one.inlet.info.as_xml() for one in recorded],
            "monitors": self._feed.fault if self._feed else None,
        }

    def close(self) -> bool:
        """Write down all that has come and close the journal; whether all of it went in."""
        self._search.close()
        whole = [one.inlet.close() for one in self._streams.values()]
        if self._feed is not None:
            self._feed.close()
        try:
            self._writer.close()
        except RecordingError as error:  # the disk is still full: footers are missing, no samples
            self._fault = str(error)
        return all(whole) and self._fault is None

    def _absent(self, request: StreamRequest) -> Health:
        """Return how a stream is that is not recorded: asked about, left out or not there."""
        # In one order, whichever answers first: a reader compares it with the last one.
        if candidates := sorted(self._candidates.get(request.label, ())):
            kind, required = request.type or "", request.required
            said = question(request.label, kind, candidates, required=required)
        elif request.confirmed == NOBODY:
            said = "was left out: no stream of its type was chosen"
        elif time.monotonic() - self._began < PATIENCE_S:
            said = absent(request)
        else:
            said = missed(request, self._search.results(), self._free_ports)
        return _absent(request, candidates, said)

    def _log_own_clock(self) -> None:
        reading = None if self._own is None else read_own_clock()
        if self._own is not None and reading is not None:
            with suppress(RecordingError):  # of a full disk the streams tell; no sample is lost
                self._writer.write_sample(self._own, reading.time, np.array(reading))

    def _wanted(self, info: "pylsl.StreamInfo") -> StreamRequest | None:
        return next((one for one in self._requests if one.matches(info)), None)

    def _start(self, info: "pylsl.StreamInfo") -> None:
        """Record a stream that was asked for; one that came back goes on where it was."""
        key = _key(info)
        request = self._wanted(info)
        if request is None:
            return
        if (recorded := self._streams.get(key)) is not None:
            recorded.inlet.follow(info)
            return
        if request.asks:
            known = self._candidates.setdefault(request.label, [])
            if (candidate := Candidate.of(info)) not in known:
                known.append(candidate)
            return
        misfits = request.misfits(info.channel_count(), info.nominal_srate())
        warnings = list(misfits)
        taken = request.taken(info.name(), info.source_id(), info.hostname())
        if (unstable := unstable_id(info.source_id())) is not None:
            warnings.append(unstable)
        inlet = Inlet(info, self._writer, request.counter, (*warnings,), self._feed, taken)
        self._streams[key] = _Recorded(request, inlet, misfits, warnings, taken or "")

    def _shape_now(self, key: _Key) -> str | None:
        """Say how a stream came back that has another shape now; None if it is there, or gone."""
        now = (one for one in self._there if one[:3] == key[:3] and one in self._streams)
        return None if key in self._there else next((_returned(key, one) for one in now), None)

    def _note_returned(self) -> None:
        """Note once beside each stream that it is another that came back in another shape."""
        for key, one in self._streams.items():
            gone = [was for was in self._before(key) if was not in self._there]
            if gone and key in self._there and one.inlet.header:
                one.warn(_returned(gone[-1], key))

    def _before(self, key: _Key) -> list[_Key]:
        """Return the streams of one source that were recorded before it had this shape."""
        alike = [one for one in self._streams if one[:3] == key[:3]]
        return alike[: alike.index(key)]

    def _note_rivals(self) -> None:
        """Note once beside each stream that it is not the only one that fits."""
        for key, one in self._streams.items():
            if key not in self._rivalled and one.inlet.header and (rivals := self._rivals(one)):
                self._rivalled.add(key)
                for text in rivals:
                    one.inlet.note("warning", text=text)

    def _rivals(self, recorded: _Recorded) -> list[str]:
        """Say which other streams fit a request for one; all are recorded, none is chosen."""
        request = recorded.request
        names = sorted(
            f"{one.inlet.info.name()!r} ({one.inlet.info.source_id()})"
            for key, one in self._streams.items()
            if one.request is request and key in self._there
        )
        if request.several or len(names) < 2:  # noqa: PLR2004
            return []
        return [
            f"fits {request}, but so do {len(names)} streams: {', '.join(names)}; give the name or "
            "source_id of the right one, or several: true"
        ]

    def _find_duplicates(self, found: "list[pylsl.StreamInfo]", now: float) -> None:
        """Warn of two live streams that LSL cannot tell apart: it may reconnect to the other."""
        for key, recorded in self._streams.items():
            alike = [
                info
                for info in found
                if _key(info) == key and now - self._since[info.uid()] > 2 * FORGET_S
            ]
            if len(alike) > 1:
                hosts = " and ".join(sorted(info.hostname() for info in alike))
                recorded.warn(
                    f"has source_id {key[0]!r} in {len(alike)} programs, on {hosts}: stop one"
                )

    def _leave_the_gone(self) -> None:
        """Let go of a source that no search finds and that sends nothing, where another is there.

        A computer that lost its power does not close its connection.
        """
        now = time.perf_counter()
        for key, recorded in self._streams.items():
            flow = recorded.inlet.flow
            silent = not flow.samples or now - flow.last > 2 * FORGET_S
            if silent and key in self._there and recorded.inlet.info.uid() not in self._since:
                recorded.inlet.leave()


def _key(info: "pylsl.StreamInfo") -> _Key:
    source = info.source_id() or info.uid()
    return source, info.name(), info.type(), info.channel_count(), info.channel_format()


def _returned(was: _Key, now: _Key) -> str:
    shape = f"{now[3]} channels instead of {was[3]}"
    if now[3] == was[3]:
        shape = "another format of its samples"
    return f"came back with {shape}: it is recorded as a new stream from then on"


def _health(recorded: _Recorded, now: float, rivals: list[str]) -> Health:
    inlet, flow, info = recorded.inlet, recorded.inlet.flow, recorded.inlet.info
    probe, signals = flow.probe, inlet.signals
    # The time of the measurement on our clock, not the time when liblsl reported it.
    age = None if probe is None else now - (probe.remote_time + probe.offset)
    health = Health(
        label=recorded.request.label,
        name=info.name(),
        type=info.type(),
        source_id=info.source_id(),
        host=info.hostname(),
        required=recorded.request.required,
        condition=condition(flow, inlet.header, now),
        samples=flow.samples,
        rate_hz=rate_of(info.name(), flow, now),
        nominal_hz=info.nominal_srate(),
        channels=info.channel_count(),
        silent_s=now - flow.last if flow.samples else None,
        offset_s=None if probe is None else probe.offset,
        offset_age_s=age,
        rtt_s=None if probe is None else probe.rtt,
        missing=flow.missing,
        resets=flow.resets,
        misfits=[*recorded.misfits, *rivals],
        warnings=[*recorded.warnings, *flow.warnings, *rivals],
        signals=list(signals.faults.values()) if signals else [],
        unwatched=signals.failed if signals else {},
        taken=recorded.taken,
    )
    health.warnings.extend(complaints(health))
    return health


def _absent(request: StreamRequest, candidates: Sequence[Candidate], said: str) -> Health:
    return Health(
        label=request.label,
        name=request.name or "",
        type=request.type or "",
        source_id=request.source_id or "",
        host="",
        required=request.required,
        condition=Condition.ASKED if candidates else Condition.ABSENT,
        samples=0,
        rate_hz=None,
        nominal_hz=request.rate_hz or 0.0,
        channels=request.channels or 0,
        silent_s=None,
        offset_s=None,
        offset_age_s=None,
        rtt_s=None,
        missing=0,
        resets=0,
        warnings=[said],
        candidates=[asdict(one) for one in candidates],
    )
