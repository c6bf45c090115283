"""MNE object of a stream of EEG, with the session's events at their samples."""

from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis.electrodes.sampled import Sampled, sampled
from labcrane.analysis.monitor_settings import monitor_setting
from labcrane.analysis.presented import presentation_failed
from labcrane.errors import PluginError, RecordingError, nearest
from labcrane.files.units import in_unit
from labcrane.recording.labels import labelled, plain
from labcrane.recording.participant_file.reader import SessionRecord, Stream
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import mne
    import pandas as pd

EEG = "EEG"

EEG_READERS = "pip install 'labcrane[eeg]'"
"""How to install the readers and writers of EEG."""

KINDS = {
    "EEG": "eeg", "EOG": "eog", "ECG": "ecg", "EKG": "ecg", "EMG": "emg", "GSR": "gsr",
    "RESP": "resp", "TEMP": "temperature", "STIM": "stim", "TRIGGER": "stim",
}  # fmt: skip
"""MNE's types of channels by those of XDF; all others are ``misc``, as they were recorded."""

ELECTRIC = ("eeg", "eog", "ecg", "emg")
"""Types that MNE has in volts."""

FAULT_COLUMNS = (("channel", object), ("kind", object), ("start", float), ("end", float))

GAP = "BAD_boundary"
"""Annotation of missing samples: MNE leaves out epochs that overlap one. Under the name that MNE
filters around, ``BAD_ACQ_SKIP``, each lost sample would end a stretch, and short ones ring."""

FAULT = "fault"
"""Prefix of annotations of a channel's faults; it is not ``BAD``, which MNE applies to all
channels."""


def eeg_streams(session: SessionRecord) -> list[Stream]:
    """Return a session's streams of the type ``EEG``, in the order of their names."""
    found = (stream for stream in session.streams.values() if stream.attrs.get("type") == EEG)
    return sorted(found, key=lambda stream: stream.name)


def to_mne(session: SessionRecord, stream: str | None = None, unit: str = "") -> "mne.io.RawArray":
    """Return a stream of EEG as MNE's ``Raw``, with the session's events as annotations.

    Samples are as they were recorded. A straight line bridges missing ones (0 in channels of
    triggers), with an annotation ``BAD_boundary`` as long as they lasted. Each event is at the
    sample that was taken when it happened, by the corrected clock; those outside of the recording
    are left out. Annotations are called by labels (docs/markers.md). Several are at one sample, so
    choose those of one name before epochs are made:
    ``mne.events_from_annotations(raw, regexp="^trial_start/")``.
    Annotations made in the viewer are ``annotation/`` and their text; a text that begins with
    ``BAD`` is not prefixed. Faults that monitors reported on a channel are ``fault/`` and their
    kind, for that channel alone (``ch_names``): the analyst decides which channels are bad.
    ``info["line_freq"]`` is the ``mains_hz`` of the protocol's monitors.

    Parameters
    ----------
    session
        Of a participant file: ``open_recording(path).session(1)``.
    stream
        Name of the stream; the only one of type ``EEG`` by default.
    unit
        Unit of channels whose unit the source does not state: ``microvolts``.

    Raises
    ------
    RecordingError
        There is no such stream, its clock was not corrected, or its unit is neither known nor
        electric.
    PluginError
        MNE is not installed.
    """
    try:
        import mne
    except ImportError as error:
        raise PluginError(f"MNE is not installed: {EEG_READERS}") from error
    chosen = _chosen(session, stream)
    signal = sampled(chosen)
    kinds = channel_types(signal, chosen)
    info = mne.create_info(list(signal.labels), signal.rate_hz, list(kinds))
    if (mains_hz := monitor_setting(session, "mains_hz")) is not None:
        info["line_freq"] = float(mains_hz)
    scale = volts(signal, chosen, unit)
    rows = np.concatenate([piece * scale for piece in bridged(signal, kinds)])
    raw = mne.io.RawArray(rows.T, info, verbose="error")
    started = datetime.fromisoformat(str(session.attrs["started"]))
    zero = session.streams["state"].time[0]
    raw.set_meas_date(started + timedelta(seconds=float(signal.time[0] - zero)))
    hz, marks, faults = signal.rate_hz, session.annotations, faults_of(session, chosen)
    began, ended = (
        signal.at(faults[edge].clip(signal.time[0], signal.time[-1]).to_numpy(float))
        for edge in ("start", "end")
    )
    spans: list[tuple[float, float, str, tuple[str, ...]]] = [
        *((at, 0.0, label, ()) for at, label in zip(*events_at(session, signal), strict=True)),
        *((at, (end - at) / hz, GAP, ()) for at, end in signal.holes.astype(np.float64)),
        *(
            (at, mark["until"] - mark["time"], _marked(mark["text"]), ())
            for at, mark in zip(
                signal.at(marks["time"].to_numpy(float)), marks.to_dict("records"), strict=True
            )
            if np.isfinite(at)
        ),
        *(
            (at, (end - at) / hz, f"{FAULT}/{plain(kind)}", (name,) * (name in signal.labels))
            for at, end, kind, name in zip(
                began, ended, faults["kind"], faults["channel"], strict=True
            )
        ),
    ]
    raw.set_annotations(
        mne.Annotations(
            [at / hz for at, _, _, _ in spans],
            [length for _, length, _, _ in spans],
            [text for _, _, text, _ in spans],
            orig_time=raw.info["meas_date"],
            ch_names=[names for _, _, _, names in spans],
        ),
        verbose="error",
    )
    return raw


def faults_of(session: SessionRecord, stream: Stream) -> "pd.DataFrame":
    """Return the faults that monitors reported on a stream: channel, kind, start, end in s, ...

    A channel is empty for the whole stream; an end is infinite where the fault lasted.
    """
    import pandas as pd

    faults = session.signal_faults
    if faults.empty:
        return pd.DataFrame({name: pd.Series([], dtype=kind) for name, kind in FAULT_COLUMNS})
    return faults[faults["stream"] == str(stream.attrs["name"])]


def _marked(text: str) -> str:
    """Return the name of an annotation; MNE leaves out epochs that overlap one named BAD..."""
    return text if text.upper().startswith("BAD") else f"annotation/{text}"


def events_at(session: SessionRecord, signal: Sampled) -> tuple[Any, list[str]]:
    """Return the rows of events, with fractions, and the events' labels.

    Those outside of the recording are left out.
    """
    events = session.events.sort_values("time", kind="stable")
    told = list(zip(events["name"].astype(str), events["data"], strict=True))
    positions = signal.at(events["time"].to_numpy(np.float64))
    inside = np.isfinite(positions)
    labels = labelled(told, presentation_failed(session))
    return positions[inside], [label for label, there in zip(labels, inside, strict=True) if there]


def channel_types(signal: Sampled, stream: Stream) -> tuple[str, ...]:
    """Return MNE's type of each channel; by default that of its stream."""
    usual = str(stream.attrs.get("type", ""))
    return tuple(KINDS.get((kind or usual).upper(), "misc") for kind in signal.kinds)


def bridged(signal: Sampled, kinds: Sequence[str]) -> Iterator[FloatArray]:
    """Yield rows, a piece at a time: a straight line where samples are missing, in triggers 0."""
    stim = np.array(kinds) == "stim"
    for piece in signal.pieces(bridged=(~stim).tolist()):
        piece[:, stim] = np.nan_to_num(piece[:, stim])
        yield piece


def volts(signal: Sampled, stream: Stream, unit: str = "") -> Any:
    """Return the factor of each channel to volts, shape ``(n_channels,)``.

    Channels that are not electric are unchanged.

    Raises
    ------
    RecordingError
        An electric channel's unit is neither stated nor given, or is not a voltage.
    """
    kinds = channel_types(signal, stream)
    scale = np.ones(len(kinds))
    for number, (kind, stated) in enumerate(zip(kinds, signal.units, strict=True)):
        if kind in ELECTRIC:
            scale[number] = _volts(stated or unit, f"{stream.name!r}, {signal.labels[number]!r}")
    return scale


def _volts(unit: str, channel: str) -> float:
    if not unit:
        raise RecordingError(
            f"channel {channel} states no unit; give the one of its source: unit='microvolts', or "
            "labcrane export --set eeg_unit=microvolts"
        )
    try:
        microvolts = in_unit(f"1 {unit}", "uV")
    except ValueError as error:
        raise RecordingError(f"the unit of channel {channel} is not a voltage: {error}") from error
    if microvolts is None:
        raise RecordingError(f"the unit {unit!r} of channel {channel} is not a voltage")
    return 1e-6 * microvolts


def _chosen(session: SessionRecord, name: str | None) -> Stream:
    if name is not None:
        if name not in session.streams:
            there = nearest(name, list(session.streams), "there is")
            raise RecordingError(f"there is no stream {name!r}; {there}")
        return session.streams[name]
    found = eeg_streams(session)
    if len(found) != 1:
        names = ", ".join(repr(stream.name) for stream in found) or "none"
        raise RecordingError(
            f"the session's streams of type {EEG!r} are {names}; choose one: stream='NAME'"
        )
    return found[0]
