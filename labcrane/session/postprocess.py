"""Postprocessing of a session in its participant file: corrected clocks, and the sync report."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis.presented import judge_interrupted, judge_presented
from labcrane.core.findings import Finding, Verdict
from labcrane.errors import LabcraneError, RecordingError
from labcrane.protocol.streams import StreamNeed, TimeLimits
from labcrane.recording.foreign_streams import RecordedStream
from labcrane.recording.own_streams import ESTIMATED, stated_terms
from labcrane.recording.participant_file.columns import text_of, write_attributes
from labcrane.recording.participant_file.reader import SessionRecord, Stream, session_in
from labcrane.recording.participant_file.recorrect import read_channel, read_stream
from labcrane.recording.participant_file.session_group import write_sync_report
from labcrane.recording.participant_file.stream_group import write_time, write_uncorrected
from labcrane.recording.pictures import CAPTURED, LEVEL, LOG
from labcrane.streams.edges import QUIET_S, Change
from labcrane.streams.recorder.health import counter_label
from labcrane.streams.sync.correction import Treatment, as_stated, correct
from labcrane.streams.sync.pool import pooled
from labcrane.streams.sync.raw import RawStream, raw_of, unwrapped
from labcrane.streams.sync.report.limits import Limits
from labcrane.streams.sync.report.loop_back import LoopBack, judge_loop_back
from labcrane.streams.sync.report.stream_report import (
    StreamReport,
    judge_stream,
    uncorrected_stream,
)
from labcrane.streams.sync.report.sync_report import LoopReport, SyncReport, judge_loop, never_came
from labcrane.streams.sync.resync import columns_of, quality_of, treatment_of
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import h5py


NO_SPACES: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class _Read:
    """A stream as the file contains it, and the study's entry for it."""

    group: "h5py.Group"
    recorded: RecordedStream
    raw: RawStream
    label: str | None
    need: StreamNeed | None


def conclude(group: "h5py.Group", spaces: Mapping[str, str] = NO_SPACES) -> SyncReport:
    """Correct and judge the streams of a session, by its protocol, from its group in the file.

    May be repeated for ever: nothing recorded is altered, and earlier times are kept.

    Parameters
    ----------
    spaces
        Spaces of gaze streams, by the names of their groups, as declared after the recording.
    """
    context = json.loads(text_of(group["context"]))
    needs = {
        label: StreamNeed.model_validate(_as_now(need))
        for label, need in context.get("streams", {}).items()
    }
    limits = TimeLimits.model_validate(context.get("sync", {})).limits()
    streams = [_read(one, needs) for one in group.get("streams", {}).values()]
    raws = pooled([one.raw for one in streams], [one.recorded.header.host for one in streams])
    end = _end(group, raws)
    for one in streams:
        _write_space(one, spaces)
    judged = [_corrected(one, raw, end, limits) for one, raw in zip(streams, raws, strict=True)]
    came = {one.label for one in streams}
    missing = {label: need.required for label, need in needs.items() if label not in came}
    # A session as fast as it goes is without LSL.
    absent = tuple(missing) if group.attrs.get("fast") == "yes" else ()
    never = () if absent else never_came(missing)
    with session_in(group) as session:
        shown = judge_presented(session), judge_interrupted(session)
        looped = [
            _loop_back(session, one, judge.quality.error_p95_s, channel, of)
            for one, judge in zip(streams, judged, strict=True)
            for channel, of in (one.need.sees if one.need else {}).items()
        ]
        for one, judge in zip(streams, judged, strict=True):
            looped += _filmed_back(session, one, judge.quality.error_p95_s, context)
    report = SyncReport(
        tuple(judged), _loop(group, context, limits), never, absent, *shown, tuple(looped)
    )
    write_sync_report(group, report.as_json())
    return report


def _as_now(need: dict[str, Any]) -> dict[str, Any]:
    """Return a stream's entry with ``stamped`` for ``pauses``, which recordings of before have."""
    now = dict(need)
    if now.pop("pauses", False):
        now["stamped"] = "at_sampling"
    return now


def _read(group: "h5py.Group", needs: dict[str, StreamNeed]) -> _Read:
    recorded = read_stream(group)
    header = recorded.header
    label, need = next(
        ((label, need) for label, need in needs.items() if need.is_for(header)), (None, None)
    )
    raw = raw_of(recorded)
    counting = counter_label(header, None if need is None else need.counter)
    counts = None if counting is None else read_channel(group, counting)
    if counts is not None and (index := unwrapped(counts)) is not None:
        raw = replace(raw, index=index)
    return _Read(group, recorded, raw, label, need)


def _end(group: "h5py.Group", raws: Sequence[RawStream]) -> float | None:
    """Return when the recording ended: the last time that it contains, on our clock."""
    lasts = [float(group["time"][-1])] if len(group["time"]) else []
    lasts += [float(raw.arrivals[-1, 1]) for raw in raws if len(raw.arrivals)]
    lasts += [float(raw.probes[:, 3].max()) for raw in raws if len(raw.probes)]
    return max(lasts, default=None)


def _corrected(one: _Read, raw: RawStream, end: float | None, limits: Limits) -> StreamReport:
    """Write a stream's times, and return how right they are."""
    try:
        treatment = _treatment(one)
        if stated := stated_terms(one.recorded.header.name):
            terms = {term: one.group[f"data/{term}"][:] for term in stated}
            corrected = as_stated(raw, terms, end)
        else:
            corrected = correct(raw, treatment, end)
    # One stream's clock must not keep a session from its file; nor may what nobody foresaw of it.
    except Exception as error:  # noqa: BLE001
        why = str(error) if isinstance(error, LabcraneError) else f"{error!r}; please report this"
        write_uncorrected(one.group, why)
        return uncorrected_stream(one.recorded, why)
    write_time(one.group, columns_of(corrected), quality_of(corrected, treatment))
    estimated = one.recorded.header.name.startswith(ESTIMATED)
    required = not estimated if one.need is None else one.need.required
    return judge_stream(one.recorded, corrected.quality, limits, required=required)


def _loop_back(
    session: SessionRecord, one: _Read, stated_s: float, channel: str, of: str
) -> LoopBack:
    """Compare a sensor's channel with what the session showed or played."""

    def signal() -> tuple[FloatArray, FloatArray]:
        stream = session.streams[one.group.name.rpartition("/")[2]]
        return stream.time, np.asarray(stream.column(channel), np.float64)

    return _looped((one.recorded.header.name, channel, of), session, signal, stated_s)


def _filmed_back(
    session: SessionRecord, one: _Read, stated_s: float, context: Mapping[str, Any]
) -> list[LoopBack]:
    """Compare the brightness or loudness of a film with the view or sound that it sees."""
    name = one.recorded.header.name
    film = name.removeprefix(CAPTURED)
    settings = context.get("components", {}).get(f"recordings.{film}", {}).get("settings", {})
    if film == name or not (of := settings.get("sees")):
        return []

    def signal() -> tuple[FloatArray, FloatArray]:
        return session.films[film].level(settings["sees_part"])

    found = _looped((name, LEVEL, of), session, signal, stated_s, upright=True)
    declared = settings.get("lag_s")
    return [replace(found, declared_s=math.nan if declared is None else declared)]


def _looped(
    names: tuple[str, str, str],
    session: SessionRecord,
    signal: Callable[[], tuple[FloatArray, FloatArray]],
    stated_s: float,
    *,
    upright: bool = False,
) -> LoopBack:
    try:
        changes, light = _changes(session, names[2])
        return judge_loop_back(names, changes, signal(), stated_s, light=light, upright=upright)
    # A sensor must not keep a session from its file, whatever it or its stream is.
    except Exception as error:  # noqa: BLE001
        told = error if isinstance(error, LabcraneError) else f"{error!r}; please report this"
        finding = replace(Finding.failed(RecordingError(str(told))), verdict=Verdict.WARN)
        return LoopBack(*names, stated_s, Verdict.WARN, findings=(finding,))


def _changes(session: SessionRecord, of: str) -> tuple[list[Change], bool]:
    """Return what a view or sound logged that a sensor notices, and whether it is light."""
    log = session.streams.get(LOG + of)
    if log is None:
        raise RecordingError(
            f"what {of!r} presented was not recorded; look for its failure among the events"
        )
    if "patch" in log.units:
        return _patch_changes(log), True
    # A sound or a vibration logs only while it is there.
    began = np.flatnonzero(np.diff(log.time, prepend=-np.inf) > QUIET_S)
    return [Change(float(log.time[k]), up=True) for k in began], False


def _patch_changes(log: Stream) -> list[Change]:
    """Return when the patch of a view changed, by its log."""
    shown = log.columns(("flip.time", "patch"))
    known = np.isfinite(shown["patch"])
    white, at = shown["patch"][known] > 0.0, shown["flip.time"][known]
    changed = np.flatnonzero(white[1:] != white[:-1]) + 1
    return [Change(float(at[k]), bool(white[k])) for k in changed]


def _write_space(one: _Read, spaces: Mapping[str, str]) -> None:
    """Write a gaze stream's space if it is declared; the last declaration holds."""
    said = spaces.get(one.group.name.rpartition("/")[2])
    if said is None and "space" not in one.group.attrs and one.need is not None:
        said = one.need.space
    if said is not None:
        write_attributes(one.group, {"space": said})


def _treatment(one: _Read) -> Treatment:
    header = one.recorded.header
    return treatment_of(header) if one.need is None else one.need.treatment(header)


def _loop(group: "h5py.Group", context: dict[str, Any], limits: Limits) -> LoopReport | None:
    """Judge the loop; None where there was none, or its clock was moved by hand."""
    rate_hz = context.get("rate_hz")
    if context.get("clock") == "manual" or rate_hz is None or "loop" not in group:
        return None
    if not all(name in group["loop"] for name in ("due", "woke", "tick")):
        return None
    due, woke, tick = (np.asarray(group[f"loop/{name}"][:]) for name in ("due", "woke", "tick"))
    same_part = np.diff(group["part"][:]) == 0
    dropped = int(np.sum((np.diff(tick) - 1.0)[same_part]))
    return judge_loop(due, woke, float(rate_hz), limits, dropped)
