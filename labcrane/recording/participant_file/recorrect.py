"""New correction of the clocks of a participant file's streams, from nothing but the file."""

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labcrane.recording.foreign_streams import OWN_CLOCK_CHANNELS, Note, RecordedStream
from labcrane.recording.participant_file.columns import text_of, texts_of
from labcrane.recording.participant_file.reader import existing_recording
from labcrane.recording.participant_file.stream_group import TIME_COLUMNS
from labcrane.recording.participant_file.verification import bring_to_disk
from labcrane.recording.participant_file.writer import Conclude, check_copied, opened, renewed
from labcrane.recording.xdf.header import StreamHeader
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import h5py


def recorrect(path: Path, conclude: Conclude) -> dict[int, list[str]]:
    """Correct the times of every stream of every session again; return the streams by session.

    The file is replaced by a new one in one step; raw timestamps, probes and samples are copied
    unchanged.

    Raises
    ------
    RecordingError
        The file cannot be read or written; it is as it was.
    """
    import h5py  # noqa: PLC0415 - loads for a second

    existing_recording(path)  # which says what to do when there is none
    done: dict[int, list[str]] = {}
    with renewed(path, f"labcrane resync {path}") as beside, opened(path) as old:
        with h5py.File(beside, "w") as new:
            for name in old:
                old.copy(name, new)
            for name, value in old.attrs.items():
                new.attrs[name] = value
            for name in new:
                if match := re.fullmatch(r"ses-(\d+)", name):
                    group = new[name]
                    conclude(group)
                    done[int(match[1])] = list(group.get("streams", {}))
        bring_to_disk(beside)
        with opened(beside) as new:
            check_copied(new, old, _corrected)
    return done


_TIMES = "|".join(TIME_COLUMNS)
_CORRECTED = re.compile(
    rf"ses-\d+/(sync_report|streams/[^/]+(@uncorrected|@space|/({_TIMES}|earlier)([/@].*)?))"
)


def _corrected(name: str) -> bool:
    """Whether a node, or an attribute, is what a correction writes."""
    return _CORRECTED.fullmatch(name) is not None


def read_stream(group: "h5py.Group") -> RecordedStream:
    """Return the data of a stream in a participant file that correcting its clock needs.

    The samples' values are left out: texts are empty, and data have no channels;
    :func:`read_channel` reads one.
    """
    count = len(group["time_raw"])
    probes = [group[f"clock/{name}"][:] for name in ("remote_time", "offset", "rtt", "local")]
    times, texts = group["notes/time"][:], texts_of(group["notes/data"])
    offsets = (
        np.column_stack([group["offsets/time"][:], group["offsets/value"][:]])
        if "offsets" in group
        else np.empty((0, 2))
    )
    return RecordedStream(
        header=StreamHeader.from_xml(text_of(group["header"])),
        time_raw=group["time_raw"][:],
        data=np.empty((count, 0)),
        texts=[],
        probes=np.column_stack(probes),
        arrivals=np.column_stack([group["arrival/count"][:], group["arrival/time"][:]]),
        notes=tuple(
            Note(float(time), json.loads(text)) for time, text in zip(times, texts, strict=True)
        ),
        offsets=offsets,
        starts=tuple(int(start) for start in group["starts"][:]),
        own_clock=_own_clock(group),
    )


def _own_clock(group: "h5py.Group") -> FloatArray:
    """Return the recorder's log of its own clock; nothing where it kept none."""
    session = group.parent.parent
    if "own_clock" not in session:
        return np.empty((0, len(OWN_CLOCK_CHANNELS)))
    return np.column_stack([session[f"own_clock/{one.label}"][:] for one in OWN_CLOCK_CHANNELS])


def read_channel(group: "h5py.Group", label: str) -> FloatArray | None:
    """Return one channel of numbers of a stream, by its label, shape ``(n,)``; None without it."""
    for dataset in group["data"].values():
        if str(dataset.attrs.get("name", "")) == label and dataset.dtype.kind in "fi":
            return np.asarray(dataset[:], np.float64)
    return None
