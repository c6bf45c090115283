"""A session in real time whose photodiode is recorded by an amplifier with a clock of its own."""

import subprocess
import sys
from pathlib import Path

import pytest
from faults.sessions import STUDY, finished, labcrane, unique
from needs import GRAPHICS, needs

from labcrane import open_recording

LATE_S = 0.0273
AHEAD_S = 7000
"""By how much the amplifier's clock is ahead."""

SEES = """\
views:
  window:
    {{use: view, display: hidden, renderer: software, size: [99, 99], patch: {{on: [trial.start]}}}}
streams:
  eeg: {{source_id: {source}, rate_hz: 1000, sees: {{display: window}}}}
"""


@pytest.mark.slow
@needs(*GRAPHICS, "clocks")
def test_a_photodiode_on_another_clock_shows_the_delay_that_was_put_in(tmp_path: Path) -> None:
    source = unique("amplifier")
    study = STUDY.replace("movements: 1, limit_s: 0.3", "movements: 8, limit_s: 0.8") + SEES
    protocol = tmp_path / "protocol.yaml"
    protocol.write_text(study.format(study=unique("loop-back"), source=source), encoding="utf-8")
    sensor = Path(__file__).parents[1] / "helpers" / "sensor.py"
    another_clock = ("unshare", "-r", "--time", f"--monotonic={AHEAD_S}", "--fork", "--kill-child")
    seen = ("display", source, "labcrane.feedback.window", "flip.time", "patch", str(LATE_S), "0.4")
    amplifier = subprocess.Popen([*another_clock, sys.executable, str(sensor), *seen])
    try:
        words = ("--participant", "P001", "--simulate", "--feedback", "--data", tmp_path / "data")
        said = finished(labcrane("run", protocol, *words))
    finally:
        amplifier.kill()
        amplifier.wait()
    (file,) = (tmp_path / "data").rglob("*.h5")
    session = open_recording(file).session(1)
    (found,) = session.sync_report["loop_back"]
    assert (found["channel"], found["of"], found["verdict"]) == ("display", "window", "PASS"), found
    assert found["delay"]["seen"] == found["delay"]["asked"] > 8
    assert abs(found["delay"]["mean_s"] - LATE_S) < 0.3e-3
    eeg = session.streams[source]
    assert float(eeg.time_raw[0] - eeg.time[0]) == pytest.approx(AHEAD_S, abs=1e-3)
    assert "changes of window, 27." in said
