"""Streams of every kind in BIDS and MNE: each value is at the time that a header alone gives it."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from needs import needs
from numpy.random import Generator, default_rng

from labcrane import FloatArray
from labcrane.analysis import find_cohort, to_mne
from labcrane.recording import Channel, SessionRecord, StreamHeader, XdfWriter
from labcrane.testing import ch8
from labcrane_bids.bids import Bids
from labcrane_bids.settings import BidsSettings
from results.consumers import bids_errors
from results.recorded import STUDY, record, study, write_stream

FIRST = 100.0
"""Time of the session's first tick."""

BEGIN = 92.0
"""Time from which streams may send."""

UNSURE_S = 0.1
"""Accuracy of corrected times, as the file states it, from which on nothing can be compared."""

SIDES = {"": "cyclopean", "left": "left", "L": "left", "right": "right", "R": "right"}

MONITORED = f"{STUDY}monitors:\n  eeg: {{use: eeg_signal, mains_hz: 60}}\n"

DESCRIBED = {
    "acquisition": {"manufacturer": "Amps  Ltd", "model": "A64", "serial_number": "17"},
    "reference": {"label": "TP9"},
    "cap": {"name": "Cap M", "manufacturer": ""},
}
FACTS = {
    "Manufacturer": "Amps Ltd",
    "ManufacturersModelName": "A64",
    "DeviceSerialNumber": "17",
    "EEGReference": "TP9",
    "CapManufacturersModelName": "Cap M",
    "PowerLineFrequency": 60,
}
"""What BIDS says of that amplifier."""

LATE = 0.005
"""Part of its samples that are stamped late by more than half a period, though none is missing."""

STEM = "sub-P001/ses-01/{0}/sub-P001_ses-01_task-acquisition"


@dataclass(frozen=True)
class Drawn:
    """A stream whose samples hold their own time, and what may be expected of it."""

    name: str
    type: str
    stated_hz: float
    time: FloatArray
    drift: float
    tolerance_s: float
    """By how much the time by header may be off; NaN for a stream without a rate."""
    eyes: tuple[str, ...]
    """Sides of the eyes whose place and pupil it has; none but for gaze."""

    @property
    def labels(self) -> list[str]:
        """Labels of the channels, in the order of any program."""
        return ["t", *(f"{eye} {what}".strip() for what in ("Gaze Y", "pupil", "Gaze X")
                       for eye in self.eyes)]  # fmt: skip

    def value(self, label: str) -> FloatArray:
        """Return what a channel holds: its own number more than the time."""
        return self.time - FIRST + 1000.0 * self.labels.index(label)

    def write(self, writer: XdfWriter) -> None:
        channels = tuple(Channel(label, "s") for label in self.labels)
        header = StreamHeader(self.name, self.type, channels, "double64", self.stated_hz, self.name)
        data = np.column_stack([self.value(label) for label in self.labels])
        write_stream(writer, header, self.time, 321.0, data, drift=self.drift)


def drawn(random: Generator, number: int, end: float) -> Drawn:
    """Return a stream: regular or not, stated rightly or not, with holes and restarts."""
    letters = list("aZ09 _-.é心")
    name = f"é{''.join(random.choice(letters, 4))}{number}"
    kind = str(random.choice(["EDA", "ECG", "Gaze", "Gaze"]))
    eyes: tuple[str, ...] = ()
    if kind == "Gaze":
        eyes = [("",), ("left", "right"), ("right",), ("R", "L")][random.integers(4)]
    start = BEGIN + random.uniform(0.0, 20.0)
    drift = random.uniform(-1e-4, 1e-4)
    if number % 4 == 0:  # heartbeats, or an eye's samples as they come
        mean = random.choice([0.8, 0.02])
        steps = mean * np.clip(random.normal(1.0, 0.2, int((end - start) / mean)), 0.2, None)
        return Drawn(name, kind, 0.0, start + np.cumsum(steps), drift, np.nan, eyes)
    rate = float(np.round(np.exp(random.uniform(np.log(2.0), np.log(120.0))), 3))
    time = np.arange(start, end, 1.0 / rate)
    keep = np.ones(len(time), bool)
    restarts = bool(random.integers(2))
    for _ in range(random.integers(4)):
        begin, lasts = random.integers(0.9 * len(time)), random.uniform(2.0 / rate, 9.0)
        keep[begin : begin + max(2, int(lasts * rate))] = False
        if restarts:
            time[begin:] += random.uniform(0.0, 1.0 / rate)
    stated = rate * float(random.choice([1.0, 1.0, 1.0, 0.5, 1.3]))
    tolerance = 2e-3 + (0.6 / rate if restarts else 0.0)
    return Drawn(name, kind, stated, time[keep], drift, tolerance, eyes)


@dataclass(frozen=True)
class Recorded:
    folder: Path
    streams: list[Drawn]
    session: SessionRecord
    events: FloatArray


def recorded(folder: Path, seed: int, count: int) -> Recorded:
    random = default_rng(seed)
    streams: list[Drawn] = []
    times: list[FloatArray] = []

    def write(writer: XdfWriter, end: float, events: FloatArray) -> None:
        streams.extend(drawn(random, number, end) for number in range(count))
        for each in streams:
            each.write(writer)
        times.append(events)
        rate = float(random.integers(100, 250))
        time = np.arange(events[0] + 2.0, events[-1] - 2.0, 1.0 / rate)
        keep = np.ones(len(time), bool)
        for at in random.choice(events[5:-5], 3, replace=False):  # events without a sample
            keep[np.abs(time - at - random.uniform(-0.5, 0.5)) < random.uniform(0.6, 3.0)] = False
        channels = (Channel("Cz", "uV", "EEG"), Channel("trigger", "", "Trigger"))
        header = StreamHeader("amp", "EEG", channels, "double64", rate, "amp", DESCRIBED)
        data = np.column_stack([time - FIRST, np.zeros(len(time))])
        late = np.where(random.random(len(time)) < LATE, random.uniform(0.55, 0.9) / rate, 0.0)
        write_stream(writer, header, (time + late)[keep], -55.0, data[keep])

    record(study(folder, MONITORED), folder / "data", "P001", also=write)
    (one,) = find_cohort(folder / "data").included
    out = folder / "bids"
    out.mkdir()
    Bids(BidsSettings(), ch8()).export([one], out)
    return Recorded(out, streams, next(one.sessions())[1], times[0])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return recorded(tmp_path_factory.mktemp("drawn"), int(default_rng().integers(1 << 30)), 10)


def by_header(folder: Path) -> Iterator[tuple[tuple[str, str], FloatArray, pd.DataFrame]]:
    """Yield stream and eye, times and values of each recording, as BIDS says to read one."""
    for path in folder.rglob("*_physio.json"):
        about = json.loads(path.read_text(encoding="utf-8"))
        table = pd.read_csv(
            path.with_suffix(".tsv.gz"), sep="\t", header=None, names=about["Columns"],
            na_values="n/a",
        )  # fmt: skip
        times = about["StartTime"] + np.arange(len(table)) / about["SamplingFrequency"]
        name = about["Description"].removeprefix("LSL stream ")
        yield (name, about.get("RecordedEye", "")), times, table


def test_every_value_is_at_the_time_of_its_row_and_no_stream_is_lost(made: Recorded) -> None:
    found = {name: (times, table) for name, times, table in by_header(made.folder)}
    text = (made.folder / "README").read_text(encoding="utf-8")
    for each in made.streams:
        if np.isnan(each.tolerance_s):
            assert each.name not in {name for name, _ in found}
            assert f"{each.name} (no steady rate; sessions: 1)" in text
            continue
        unsure = made.session.streams[each.name].attrs["error_p95_s"] > UNSURE_S
        for number, eye in enumerate(each.eyes or (None,)):
            side = "" if eye is None else SIDES[eye]
            times, table = found.pop((each.name, side), (None, None))
            if unsure:
                continue
            assert np.abs(table["timestamp"] - times).max() < each.tolerance_s, each
            assert table["timestamp"].is_monotonic_increasing
            columns = {"t": "t"} if number == 0 else {}
            if eye is not None:
                assert table.columns[1:3].tolist() == ["x_coordinate", "y_coordinate"]
                columns |= {"x_coordinate": f"{eye} Gaze X".strip(),
                            "y_coordinate": f"{eye} Gaze Y".strip(),
                            "pupil_size": f"{eye} pupil".strip()}  # fmt: skip
            assert set(table) == {"timestamp", *columns}
            for column, label in columns.items():
                values = table[column]
                there = values.notna()
                np.testing.assert_allclose(values[there], each.value(label), atol=1e-9)
                moments = values - 1000.0 * each.labels.index(label)
                assert np.abs(times - moments)[there].max() < each.tolerance_s, each
    assert found == {}


def whole(made: Recorded, before: float, after: float) -> FloatArray:
    """Return the events around which no sample of EEG is missing."""
    eeg = made.session.streams["amp"]
    taken = eeg.data["Cz"] + FIRST
    period = np.median(np.diff(taken))
    near = [(taken >= at - before - period) & (taken <= at + after + period) for at in made.events]
    counts = np.array([np.count_nonzero(each) for each in near])
    return made.events[counts >= int((before + after) / period)]


def test_eeg_by_its_header_has_every_event_where_it_was(made: Recorded) -> None:
    folder = made.folder / STEM.format("eeg")
    about = json.loads(Path(f"{folder}_eeg.json").read_text(encoding="utf-8"))
    assert {name: about[name] for name in FACTS} == FACTS
    assert "CapManufacturer" not in about
    values = np.fromfile(f"{folder}_eeg.eeg", "<f4").reshape(-1, 2)
    events = pd.read_csv(f"{folder}_events.tsv", sep="\t", na_values="n/a")
    bad = events["trial_type"] == "BAD_boundary"
    own = events[~bad]
    assert len(own) == len(made.events)
    first, period = values[0, 0], 1.0 / about["SamplingFrequency"]
    off = np.abs(own["onset"] + first - (made.events - FIRST))
    assert np.quantile(off, 0.9) < 3e-3
    assert off.max() < period + 1e-3, "beside a late stamp by less than a sample"
    inside = own.dropna(subset="sample")
    assert 0 < len(inside) < len(own)
    at = values[inside["sample"].astype(int), 0]
    assert np.abs(at - first - inside["onset"]).max() < 1.1 * period + 1e-3
    assert np.abs(values[:, 0] - first - period * np.arange(len(values))).max() < period + 1e-3
    missing = np.zeros(len(values), bool)
    for start, lasts in zip(events["onset"][bad], events["duration"][bad], strict=True):
        rows = np.rint(np.array([start, start + lasts]) * about["SamplingFrequency"]).astype(int)
        missing[slice(*rows)] = True
    assert np.count_nonzero(~missing) == len(made.session.streams["amp"])
    assert missing[inside["sample"].astype(int)].sum() >= 3
    assert not values[:, 1].any()


@pytest.mark.slow
@needs("mne", "mne_bids", "bids-validator-deno")
@pytest.mark.parametrize("seed", range(2))
def test_mne_makes_epochs_of_whole_data_alone_and_filters_across_holes(
    seed: int, tmp_path: Path
) -> None:
    import mne
    import mne_bids

    made = recorded(tmp_path, seed, 12)
    assert bids_errors(made.folder) == []
    path = mne_bids.BIDSPath(
        root=made.folder, subject="P001", session="01", task="acquisition", datatype="eeg"
    )
    stored = mne_bids.read_raw_bids(path, verbose="error")
    direct = mne.io.read_raw_brainvision(path.fpath, verbose="error")
    expected = whole(made, 0.2, 0.3)
    assert 0 < len(expected) < len(made.events) - 3
    assert stored.info["line_freq"] == to_mne(made.session).info["line_freq"] == 60.0
    for raw in (to_mne(made.session), stored, direct):
        raw.load_data(verbose="error")
        events, ids = mne.events_from_annotations(raw, verbose="error")
        own = events[[not _is_bad(code, ids) for code in events[:, 2]]]
        epochs = mne.Epochs(
            raw, own, tmin=-0.2, tmax=0.3, baseline=None, preload=True,
            event_repeated="drop", verbose="error",
        )  # fmt: skip
        data = epochs.get_data(picks=[0], verbose="error")
        assert not np.isnan(data).any()
        zero = data[:, 0, np.argmin(np.abs(epochs.times))] * 1e6 + FIRST
        apart = np.unique(np.round(expected * raw.info["sfreq"]))
        assert abs(len(zero) - len(apart)) <= 2, "the first and the last may be on either side"
        assert max(np.abs(expected - at).min() for at in zero) < 1.1 / raw.info["sfreq"] + 1e-3
    filtered = to_mne(made.session).filter(None, 30.0, picks=[0], verbose="error")
    assert np.isfinite(filtered.resample(50.0, verbose="error").get_data()).all()


def _is_bad(code: int, ids: dict[str, int]) -> bool:
    (name,) = (name for name, number in ids.items() if number == code)
    return name.upper().startswith(("BAD", "NEW SEGMENT"))
