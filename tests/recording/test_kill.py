"""SIGKILL: real processes, killed at random moments."""

import json
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import pyxdf
from own_modules import OWN_MODULES
from recording import journals
from recording.journals import frames, stamp, write

from labcrane import open_recording
from labcrane.recording.participant_file.recover import recover
from labcrane.recording.participant_file.writer import consolidate
from labcrane.recording.paths import next_part
from labcrane.recording.xdf.reader import read_xdf

ENVIRONMENT = {**os.environ, "PYTHONPATH": OWN_MODULES}


def killed_writer(path: Path, after_s: float, pause: float) -> list[int]:
    """Let a process write frames, kill it, and return those it said it had written."""
    process = subprocess.Popen(
        [sys.executable, journals.__file__, str(path), str(pause)],
        stdout=subprocess.PIPE,
        encoding="utf-8",
        env=ENVIRONMENT,
    )
    assert process.stdout is not None
    told = [process.stdout.readline()]
    time.sleep(after_s)  # the moment of death, not a wait for something
    process.kill()
    told += process.stdout.readlines()
    process.wait()
    process.stdout.close()
    return [json.loads(line) for line in told if line.endswith("\n")]


@pytest.mark.parametrize("moment", range(5))
def test_every_frame_that_was_written_survives_the_writer(tmp_path: Path, moment: int) -> None:
    path = tmp_path / "ses-01_run.xdf"
    after = random.Random(moment).uniform(0.0, 0.6)
    told = killed_writer(path, after, 0.0 if moment % 2 else 0.001)
    file = read_xdf(path)
    stream = file.stream("labcrane.frames")
    assert len(told) <= len(stream.stamps) <= len(told) + 1
    np.testing.assert_array_equal(stream.data, frames(len(stream.stamps)))
    np.testing.assert_array_equal(stream.stamps, [stamp(k) for k in range(len(stream.stamps))])
    assert not file.damaged
    streams, _ = pyxdf.load_xdf(path, dejitter_timestamps=False, synchronize_clocks=False)
    (theirs,) = (s for s in streams if s["info"]["name"] == ["labcrane.frames"])
    np.testing.assert_array_equal(theirs["time_series"], stream.data)


def test_a_killed_session_and_the_one_that_goes_on_end_up_in_one_recording(tmp_path: Path) -> None:
    path = tmp_path / "P001" / "ses-01_run.xdf"
    path.parent.mkdir()
    killed_writer(path, 0.1, 0.001)
    count = len(read_xdf(path).stream("labcrane.frames").stamps)
    assert next_part(path).name == "ses-01_run.part2.xdf"
    write(next_part(path), 40, first=count)
    (recovery,) = recover(tmp_path)
    assert recovery.problem == ""
    session = open_recording(recovery.path).session(1)
    state = session.streams["state"]
    np.testing.assert_array_equal(state.data.to_numpy(), frames(count + 40)[:, 4:6])
    assert list(session.events.query("name == 'session.start'")["part"]) == [1, 2]


RECOVER = """
import sys
from pathlib import Path
import h5py, pandas
from labcrane.recording.participant_file.recover import recover
print("go", flush=True)
recover(Path(sys.argv[1]))
print("done", flush=True)
"""


def how_long_recover_takes(folder: Path, file: Path, before: bytes) -> float:
    """Let it run to its end, as nobody kills it, and undo what it has done; return the seconds."""
    program = [sys.executable, "-c", RECOVER, str(folder)]
    with subprocess.Popen(
        program, stdout=subprocess.PIPE, encoding="utf-8", env=ENVIRONMENT
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "go\n"
        began = time.perf_counter()
        assert process.stdout.read() == "done\n"
        took = time.perf_counter() - began
    assert file.read_bytes() != before
    file.write_bytes(before)
    return took


@pytest.mark.parametrize(
    "kills",
    [
        pytest.param(12, marks=pytest.mark.long),
        pytest.param(60, marks=[pytest.mark.soak, pytest.mark.timeout(1200)]),
    ],
)
def test_recover_may_be_killed_at_any_moment_and_repeated(tmp_path: Path, kills: int) -> None:
    folder = tmp_path / "P001"
    folder.mkdir()
    first, second = folder / "ses-01_run.xdf", folder / "ses-02_run.xdf"
    write(first, 50)
    consolidate(folder / "P001.h5", [first])
    before = (folder / "P001.h5").read_bytes()
    write(second, 40_000)
    whole = how_long_recover_takes(tmp_path, folder / "P001.h5", before)
    killed = 0
    for moment in range(kills):
        process = subprocess.Popen(
            [sys.executable, "-c", RECOVER, str(tmp_path)],
            stdout=subprocess.PIPE,
            encoding="utf-8",
            env=ENVIRONMENT,
        )
        assert process.stdout is not None
        assert process.stdout.readline() == "go\n"
        time.sleep(random.Random(moment).uniform(0.0, whole))  # the moment of death
        process.kill()
        killed += process.stdout.read() == ""
        process.wait()
        process.stdout.close()
        if (folder / "P001.h5").read_bytes() != before:
            assert open_recording(folder / "P001.h5").sessions == [1, 2]
            (folder / "P001.h5").write_bytes(before)
    assert killed >= kills / 2, "most kills must fall within its work"
    recover(tmp_path)
    recording = open_recording(folder / "P001.h5")
    assert recording.sessions == [1, 2]
    for number, count in ((1, 50), (2, 40_000)):
        data = recording.session(number).streams["state"].data.to_numpy()
        np.testing.assert_array_equal(data, frames(count)[:, 4:6])
    assert sorted(entry.name for entry in folder.iterdir()) == [
        "P001.h5",
        "ses-01_run.xdf",
        "ses-02_run.xdf",
    ]
