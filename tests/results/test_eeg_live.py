"""An amplifier of another program, a session in real time, and MNE: over real LSL."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pylsl
import pytest
from faults.sessions import finished, labcrane, unique
from needs import needs
from rehearsal import SHORT

from labcrane import open_recording
from labcrane.analysis import sampled, to_mne

RATE_HZ = 500.0
BEHIND_S = 0.6
"""How long after its time a sample is sent: so long a marker may be under way to the amplifier, and
what is found out later, as the onset of a movement, gets no pulse."""


class Amplifier:
    """Sends EEG, with a pulse at the sample nearest to each marker that it hears.

    Attributes
    ----------
    heard
        Stamp and label of each marker.
    marked
        Those that have a pulse.
    """

    def __init__(self, study: str) -> None:
        self.heard: list[tuple[float, str]] = []
        self.marked: set[tuple[float, str]] = set()
        self.name = f"amplifier of {study}"
        self._asked = f"name='labcrane.labels' and starts-with(source_id,'labcrane/{study}/')"
        info = pylsl.StreamInfo(self.name, "EEG", 2, RATE_HZ, "float32", self.name)
        channels = info.desc().append_child("channels")
        for label, kind, unit in (("Cz", "EEG", "microvolts"), ("pulse", "Trigger", "")):
            channel = channels.append_child("channel")
            for key, value in (("label", label), ("type", kind), ("unit", unit)):
                channel.append_child_value(key, value)
        self._outlet = pylsl.StreamOutlet(info)
        self._zero = pylsl.local_clock()
        self._over = threading.Event()

    def listen(self) -> None:
        while not self._over.is_set():
            if found := pylsl.resolve_bypred(self._asked, timeout=0.5):
                inlet = pylsl.StreamInlet(found[0], recover=False)
                while not self._over.is_set():
                    try:
                        sample, stamp = inlet.pull_sample(timeout=0.1)
                    except pylsl.util.LostError:
                        return
                    if sample is not None:
                        self.heard.append((stamp, sample[0]))

    def send(self) -> None:
        sent = 0
        while not self._over.is_set():
            time.sleep(0.02)
            until = int((pylsl.local_clock() - BEHIND_S - self._zero) * RATE_HZ)
            if until <= sent:
                continue
            chunk = np.zeros((until - sent, 2), np.float32)
            chunk[:, 0] = np.sin(0.1 * np.arange(sent, until))
            for stamp, label in list(self.heard):
                number = round((stamp - self._zero) * RATE_HZ)
                if sent <= number < until:
                    chunk[number - sent, 1] = 1.0
                    self.marked.add((stamp, label))
            self._outlet.push_chunk(chunk, self._zero + (until - 1) / RATE_HZ)
            sent = until

    @contextmanager
    def running(self) -> Iterator[None]:
        threads = [threading.Thread(target=work) for work in (self.listen, self.send)]
        for thread in threads:
            thread.start()
        try:
            yield
        finally:
            self._over.set()
            for thread in threads:
                thread.join()


@pytest.mark.long
@needs("mne")
def test_epochs_by_label_have_the_amplifiers_pulse_within_one_sample(tmp_path: Path) -> None:
    import mne

    study = unique("pulses")
    amplifier = Amplifier(study)
    text = SHORT.replace("study: rehearsal", f"study: {study}")
    text = text.replace("movements: 2", "movements: 2, limit_s: 2.5").replace(", pairs: 1", "")
    text += f"streams:\n  brain: {{name: {amplifier.name}, type: EEG}}\n"
    (tmp_path / "study.yaml").write_text(text, encoding="utf-8")
    asked = ("--participant", "P001", "--simulate", "--data", tmp_path / "data")
    with amplifier.running():
        finished(labcrane("run", tmp_path / "study.yaml", *asked))
    (path,) = tmp_path.glob("data/*/*.h5")
    session = open_recording(path).session(1)
    raw = to_mne(session)
    assert raw.info["sfreq"] == RATE_HZ
    events, ids = mne.events_from_annotations(raw, regexp="^trial_start/", verbose="error")
    epochs = mne.Epochs(
        raw, events, ids, tmin=-0.05, tmax=0.05, baseline=None, picks="stim", preload=True,
        verbose="error",
    )  # fmt: skip
    # The amplifier finds the labels a moment after they begin: what it heard are the last ones.
    heard = sum(label.startswith("trial_start/") for _, label in amplifier.marked)
    assert heard >= 5
    starts = epochs.get_data(verbose="error")[-heard:, 0]
    middle = starts.shape[1] // 2
    assert (starts[:, middle - 1 : middle + 2].max(axis=1) == 1.0).all()
    # And so is every other marker that has a pulse, under its own label.
    signal = sampled(session.streams[amplifier.name])
    told = [
        (stamp, label) for stamp, label in amplifier.marked
        if signal.time[0] < stamp < signal.time[-1]
    ]  # fmt: skip
    assert len(told) >= 15
    recorded = {round(stamp, 9) for stamp in session.events["time"]}
    assert {round(stamp, 9) for stamp, _ in told} <= recorded
    assert {label for _, label in told} <= set(raw.annotations.description)
    pulses = np.flatnonzero(signal.data[:, 1])
    positions = signal.at(np.array([stamp for stamp, _ in told]))
    assert max(np.abs(pulses - each).min() for each in positions) <= 1.0
