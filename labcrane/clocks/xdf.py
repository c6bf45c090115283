"""Correction of XDF files of any recorder, certified, and compared with pyxdf."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from labcrane.errors import RecordingError
from labcrane.files.atomic import replacing
from labcrane.recording.foreign_streams import RecordedStream, read_streams
from labcrane.recording.journal_reader import JournalState
from labcrane.recording.participant_file.columns import node_names, write_attributes, write_numbers
from labcrane.recording.participant_file.stream_group import TIME_COLUMNS
from labcrane.streams.recorder.health import counter_label
from labcrane.streams.sync.correction import Corrected, correct
from labcrane.streams.sync.pool import pooled
from labcrane.streams.sync.raw import RawStream, raw_of, unwrapped
from labcrane.streams.sync.report.limits import Limits
from labcrane.streams.sync.report.stream_report import judge_stream
from labcrane.streams.sync.report.sync_report import SyncReport
from labcrane.streams.sync.resync import columns_of, quality_of, treatment_of


@dataclass(frozen=True, slots=True)
class Resynced:
    """The result of correcting an XDF file.

    Attributes
    ----------
    path
        The HDF5 file with corrected times, their errors and their basis, per stream.
    report
        Their accuracy.
    against_pyxdf
        By stream, the median and the largest distance of the times from pyxdf's, in seconds; empty
        where pyxdf is not installed, cannot read the file, or reads other samples.
    damage
        Unreadable parts of the file, one line each.
    unread_by_pyxdf
        Why pyxdf could not read the file; empty where it could, or is not installed.
    """

    path: Path
    report: SyncReport
    against_pyxdf: dict[str, tuple[float, float]]
    damage: tuple[str, ...] = ()
    unread_by_pyxdf: str = ""


def resync_xdf(path: Path) -> Resynced:
    """Correct the streams of an XDF file by its clock offsets, into a file in the same folder.

    Raises
    ------
    RecordingError
        It cannot be read, contains no stream, or the new file cannot be written.
    """
    import h5py  # noqa: PLC0415 - loads for a second

    if not path.is_file():
        raise RecordingError(f"there is no XDF file {path}")
    streams, states = read_streams([path])
    if not streams:
        raise RecordingError(f"{path} contains no stream; it may be incomplete")
    raws = pooled([_raw(one) for one in streams], [one.header.host for one in streams])
    ends = [float(raw.probes[:, 3].max()) for raw in raws if len(raw.probes)]
    corrected = []
    for one, raw in zip(streams, raws, strict=True):
        corrected.append(correct(raw, treatment_of(one.header), max(ends, default=None)))
    report = SyncReport(
        tuple(
            judge_stream(one, each.quality, Limits())
            for one, each in zip(streams, corrected, strict=True)
        )
    )
    beside = path.with_name(f"{path.stem}_resync.h5")
    with replacing(beside) as new, h5py.File(new, "w") as file:
        names = node_names([one.header.name for one in streams])
        for (_, name), one, each in zip(names, streams, corrected, strict=True):
            group = file.create_group(name)
            write_attributes(group, {"name": one.header.name, "source_id": one.header.source_id})
            write_numbers(group, "time_raw", one.time_raw, "s")
            for column, values in columns_of(each).items():
                write_numbers(group, column, values, TIME_COLUMNS[column])
            write_attributes(group["time"], quality_of(each, treatment_of(one.header)))
    apart, why = _compared(path, streams, corrected)
    return Resynced(beside, report, apart, _damage(states), why)


def _damage(states: list[JournalState]) -> tuple[str, ...]:
    """Return what is missing from these times because it could not be read."""
    told = [note for state in states for note in state.notes]
    told += [
        f"{state.name}: its last {state.torn} bytes are not a complete XDF chunk and were left out"
        for state in states
        if state.torn
    ]
    return tuple(told)


def _raw(recorded: RecordedStream) -> RawStream:
    raw = raw_of(recorded)
    label = counter_label(recorded.header, None)
    if label is None or not len(recorded.data):
        return raw
    column = recorded.header.labels.index(label)
    index = unwrapped(np.asarray(recorded.data[:, column], np.float64))
    return replace(raw, index=index)


def _compared(
    path: Path, streams: list[RecordedStream], corrected: list[Corrected]
) -> tuple[dict[str, tuple[float, float]], str]:
    """Return how far pyxdf's times are from ours, and why it could not read the file."""
    try:
        import pyxdf  # noqa: PLC0415 - not everybody has it
    except ImportError:
        return {}, ""
    try:
        read = pyxdf.load_xdf(str(path))[0]
    except Exception as error:  # noqa: BLE001 - of a damaged file it raises whatever comes
        return {}, f"{type(error).__name__}: {error}"
    theirs = {_known_by(stream["info"]): np.asarray(stream["time_stamps"]) for stream in read}
    found = {}
    for one, each in zip(streams, corrected, strict=True):
        other = theirs.get((one.header.name, one.header.source_id))
        if other is not None and len(other) == len(each.time) > 0:
            apart = np.abs(other - each.time)
            known = apart[np.isfinite(apart)]
            if len(known):
                found[one.header.name] = float(np.median(known)), float(known.max())
    return found, ""


def _known_by(info: Mapping[str, Any]) -> tuple[str, str]:
    """Return name and source id by pyxdf, which gives an empty list for what is left out."""
    name, source = ((info.get(key) or [""])[0] or "" for key in ("name", "source_id"))
    return name, source
