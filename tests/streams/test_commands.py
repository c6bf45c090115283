"""The commands about streams and recordings, as a user types them."""

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from labcrane import open_recording
from labcrane.testing import main

SENDER = Path(__file__).parent / "emulation" / "sender.py"


@pytest.fixture(scope="module")
def source() -> Iterator[str]:
    source = f"commands-{os.getpid()}-{time.monotonic_ns()}"
    arguments = ["Amplifier", "EEG", source, "100", "0"]
    sender = subprocess.Popen([sys.executable, str(SENDER), *arguments])
    yield source
    sender.kill()
    sender.wait()


def labcrane(*arguments: object, columns: int = 200) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "labcrane", *map(str, arguments)],
        capture_output=True,
        encoding="utf-8",
        check=False,
        env={**os.environ, "COLUMNS": str(columns)},
    )


@pytest.fixture(scope="module")
def recorded(source: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded") / "alone"
    done = labcrane("record", folder, "--stream", f"source_id={source}", "--seconds", 4)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.slow
def test_streams_lists_type_rate_units_host_and_offset(source: str) -> None:
    done = labcrane("streams")
    name, channels, host, ident = done.stdout.partition(source)[0].splitlines()[-4:]
    assert name == "Amplifier: EEG, 100 Hz"
    assert channels.startswith("  channels: 2 (")
    assert "microvolts" in channels
    assert re.fullmatch(r"  host: \S+, clock offset [+-]\d\.\d{6} s", host)
    assert ident == "  source id: "


@pytest.mark.slow
def test_streams_are_watched_until_it_is_known_how_they_come(source: str) -> None:
    done = labcrane("streams", "--watch", "--seconds", 12, columns=80)
    assert done.returncode == 0, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 80
    about = " ".join(done.stdout.partition("Amplifier: ")[2].split("Amplifier: ")[0].split())
    assert about.startswith("EEG, 2 channels at 100 Hz, in 1, microvolts clock ")
    told = re.search(r"clock ([+-]\d\.\d{6}) s, [+-]\d+\.\d ppm, round trip (\d+\.\d\d) ms", about)
    assert told, about
    offset, there_and_back = float(told[1]), 1e-3 * float(told[2])
    assert abs(offset) < 0.0005 + there_and_back  # a busy computer answers its probes late
    assert "0 lost by its counter" in about
    assert "signal alive" in about


def test_what_belongs_to_the_watch_is_refused_without_it() -> None:
    done = labcrane("streams", "--seconds", 8)
    assert done.returncode != 0
    assert "--seconds and --protocol belong to --watch; add it" in done.stderr


@pytest.mark.slow
def test_streams_are_recorded_without_an_experiment(recorded: Path) -> None:
    stream = open_recording(recorded / "alone.h5").session(1).streams["Amplifier"]
    assert len(stream.time) > 100
    assert stream.attrs["corrected"]
    np.testing.assert_array_equal(np.diff(stream.data["Counter"]), 1.0)


@pytest.mark.slow
def test_the_seconds_are_counted_from_when_the_stream_is_there(tmp_path: Path) -> None:
    source = f"late-{os.getpid()}-{time.monotonic_ns()}"
    words = ["record", tmp_path / "late", "--stream", f"source_id={source}", "--seconds", 2]
    recorder = subprocess.Popen(
        [sys.executable, "-m", "labcrane", *map(str, words)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert recorder.stdout is not None
    said = ""
    while "is not on the network" not in said:
        said += recorder.stdout.readline()
    with pytest.raises(subprocess.TimeoutExpired):
        recorder.wait(3)  # longer than it was told to record
    arguments = ["Late", "EEG", source, "100", "0"]
    with subprocess.Popen([sys.executable, str(SENDER), *arguments]) as sender:
        recorder.communicate()
        sender.kill()
    assert recorder.returncode == 0
    stream = open_recording(tmp_path / "late" / "late.h5").session(1).streams["Late"]
    assert np.ptp(stream.time) > 1.5


@pytest.mark.slow
def test_a_recording_is_never_written_over(recorded: Path, source: str) -> None:
    done = labcrane("record", recorded, "--stream", f"source_id={source}", "--seconds", 1)
    assert done.returncode == 1
    assert "exists; give a new folder for the recording" in done.stderr


def test_a_stream_is_named_by_what_lsl_knows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["record", str(tmp_path / "new"), "--stream", "EEG"]) == 2
    assert "stream 'EEG' must be type=..., name=... or source_id=..." in capsys.readouterr().err


@pytest.mark.slow
def test_recover_makes_the_file_again_of_the_journals(recorded: Path, tmp_path: Path) -> None:
    folder = tmp_path / "alone"
    shutil.copytree(recorded, folder)
    (folder / "alone.h5").unlink()
    done = labcrane("recover", tmp_path)
    assert done.returncode == 0, done.stderr
    one = open_recording(recorded / "alone.h5").session(1).streams["Amplifier"]
    two = open_recording(folder / "alone.h5").session(1).streams["Amplifier"]
    np.testing.assert_array_equal(one.time, two.time)
    assert "was complete" in labcrane("recover", tmp_path).stdout


def test_recover_says_when_there_is_nothing(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    said = labcrane("recover", tmp_path).stdout.replace("\n", "")
    assert f"no journals below {tmp_path / 'data'}" in said


@pytest.mark.slow
def test_resync_corrects_again_from_the_file_alone(recorded: Path, tmp_path: Path) -> None:
    path = tmp_path / "copied.h5"
    shutil.copy(recorded / "alone.h5", path)
    before = open_recording(path).session(1).streams["Amplifier"].time
    with h5py.File(path, "a") as file:  # as if an older labcrane had corrected it worse
        file["ses-01/streams/Amplifier/time"][:] += 1.0
    done = labcrane("resync", path)
    assert done.returncode == 0, done.stderr
    assert "session 1: Amplifier" in done.stdout
    stream = open_recording(path).session(1).streams["Amplifier"]
    np.testing.assert_array_equal(stream.time, before)
    np.testing.assert_array_equal(
        stream.data, open_recording(recorded / "alone.h5").session(1).streams["Amplifier"].data
    )
