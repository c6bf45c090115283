"""EEG: each stream of that type as BrainVision files, with tables of channels and events."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis import (
    GAP,
    Sampled,
    bridged,
    channel_types,
    faults_of,
    monitor_setting,
    sampled,
    volts,
)
from labcrane.recording import SessionRecord, Stream
from labcrane_bids.brainvision import write_brainvision
from labcrane_bids.files import DEVICE, MISSING, first_tick, stated_facts, write_json, write_tsv
from labcrane_bids.settings import BidsSettings

if TYPE_CHECKING:
    import pandas as pd

TYPES = {"eeg": "EEG", "eog": "EOG", "ecg": "ECG", "emg": "EMG", "gsr": "GSR", "resp": "RESP",
         "temperature": "TEMP", "stim": "TRIG", "misc": "MISC"}  # fmt: skip
"""Types of channels in BIDS, by those of MNE."""

FACTS = {
    **DEVICE,
    "EEGReference": "reference/label",
    "CapManufacturer": "cap/manufacturer",
    "CapManufacturersModelName": "cap/name",
}
"""Facts of EEG, by their place in the description of an XDF header."""

COUNTED = {"EEG": "EEG", "EOG": "EOG", "ECG": "ECG", "EMG": "EMG", "TRIG": "Trigger"}
"""Types that a description counts, and in which word; all others are miscellaneous."""


def write_eeg(
    path: Path,
    stream: Stream,
    session: SessionRecord,
    events: "pd.DataFrame",
    task: str,
    settings: BidsSettings,
) -> Sampled:
    """Write a stream of EEG, and its events; return its samples.

    Parameters
    ----------
    path
        Of the files, without an ending: ``..._eeg``.
    events
        The session's, in order, with an onset in seconds from the session's first tick.
    """
    signal = sampled(stream)
    types = channel_types(signal, stream)
    kinds = [TYPES[kind] for kind in types]
    scale = volts(signal, stream, settings.eeg_unit)
    electric = [kind in {"EEG", "EOG", "ECG", "EMG"} for kind in kinds]
    units = ["µV" if voltage else unit or MISSING for voltage, unit in zip(
        electric, signal.units, strict=True
    )]  # fmt: skip
    path.parent.mkdir(exist_ok=True)
    table = _events(events, signal, session)
    # Only voltages are scaled; channels.tsv states the unit of the others.
    factors = np.where(electric, 1e6 * scale, scale)
    write_brainvision(
        path,
        (piece * factors for piece in bridged(signal, types)),
        signal.rate_hz,
        list(zip(signal.labels, units, strict=True)),
        _markers(table, signal),
    )
    stem = path.name.removesuffix("_eeg")
    write_tsv(path.with_name(f"{stem}_events.tsv"), table)
    write_tsv(
        path.with_name(f"{stem}_channels.tsv"), _channels(signal, kinds, units, session, stream)
    )
    mains_hz = monitor_setting(session, "mains_hz")
    about = _about(signal, stream, kinds, task, settings, mains_hz)
    write_json(path.with_name(f"{path.name}.json"), about)
    return signal


def eeg_description(about: Mapping[str, Any]) -> dict[str, Any]:
    """Return the description of the events of EEG, by that of the same ones beside motion."""
    kinds = about["trial_type"]
    gap = {GAP: "samples are missing for the duration; a straight line bridges them"}
    hed = {GAP: f"(Experiment-control, Label/{GAP})"}
    return {
        **about,
        "onset": {"Description": "from the first sample of EEG", "Units": "s"},
        "sample": {
            "Description": "number of the sample, counted from 0; n/a before the first and after "
            "the last"
        },
        "trial_type": {
            **kinds,
            "Levels": {**kinds["Levels"], **gap},
            "HED": {**kinds["HED"], **hed},
        },
    }


def _events(events: "pd.DataFrame", signal: Sampled, session: SessionRecord) -> "pd.DataFrame":
    """Return the events at their samples, and where samples are missing."""
    import pandas as pd

    times = events["onset"].to_numpy() + first_tick(session)
    samples = signal.at(times)
    edge = times.clip(signal.time[0], signal.time[-1])
    outside = signal.at(edge) + (times - edge) * signal.rate_hz
    rows = np.where(np.isnan(samples), outside, samples)
    first, after = signal.holes.T
    gaps = pd.DataFrame(
        {"onset": first, "duration": (after - first) / signal.rate_hz, "sample": first}
    )
    there = events.assign(onset=rows, sample=pd.array(np.rint(samples), dtype="Int64"))
    table = pd.concat([there, gaps.assign(trial_type=GAP)] if len(gaps) else [there])
    table = table.sort_values("onset", kind="stable", ignore_index=True)
    table["onset"] /= signal.rate_hz
    table.insert(2, "sample", table.pop("sample"))
    return table


def _markers(table: "pd.DataFrame", signal: Sampled) -> list[tuple[int, int, str]]:
    """Return sample, number of samples and name of what is within the recording."""
    inside = table[table["sample"].notna()]
    gap = inside["trial_type"] == GAP
    lengths = (inside["duration"].where(gap, 0.0) * signal.rate_hz).round().clip(lower=1)
    return list(zip(inside["sample"], lengths.astype(int), inside["trial_type"], strict=True))


def _channels(
    signal: Sampled, kinds: list[str], units: list[str], session: SessionRecord, stream: Stream
) -> "pd.DataFrame":
    """Return what channels are; monitors' faults describe one, and call none bad."""
    import pandas as pd

    faults = faults_of(session, stream)
    ended = faults["end"].clip(upper=signal.time[-1])
    said = [
        f"{kind} for {end - start:.1f} s"
        for kind, start, end in zip(faults["kind"], faults["start"], ended, strict=True)
    ]
    of = list(zip(faults["channel"], said, strict=True))
    told = ["; ".join(words for name, words in of if name in ("", each)) for each in signal.labels]
    return pd.DataFrame(
        {
            "name": signal.labels,
            "type": kinds,
            "units": units,
            "sampling_frequency": signal.rate_hz,
            "status": MISSING,
            "status_description": [words or MISSING for words in told],
        }
    )


def _about(
    signal: Sampled,
    stream: Stream,
    kinds: list[str],
    task: str,
    settings: BidsSettings,
    mains_hz: float | None,
) -> Mapping[str, Any]:
    counts = {f"{word}ChannelCount": kinds.count(kind) for kind, word in COUNTED.items()}
    others = sum(kind not in COUNTED for kind in kinds)
    error = float(stream.attrs.get("error_p95_s", float("nan")))
    clock = f"{1000.0 * error:.3f} ms at 95 %" if error == error else "not known"  # noqa: PLR0124
    return {
        "TaskName": task,
        "EEGReference": MISSING,
        **stated_facts(stream, FACTS),
        **({"EEGReference": settings.eeg_reference} if settings.eeg_reference else {}),
        "SamplingFrequency": signal.rate_hz,
        "PowerLineFrequency": settings.power_line_hz or mains_hz or MISSING,
        "SoftwareFilters": MISSING,
        "HardwareFilters": MISSING,
        "RecordingType": "discontinuous" if len(signal.holes) else "continuous",
        "RecordingDuration": len(signal) / signal.rate_hz,
        **counts,
        "MiscChannelCount": others,
        "Description": f"LSL stream {stream.name}; clock corrected, off by {clock}",
    }
