"""Recorders that are killed at random moments, alone or both at once, beside two LSL witnesses."""

import random
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import psutil
import pytest
from faults.sessions import program, unique, witnessed

from labcrane.processes.handle import ProcessHandle
from labcrane.recording.foreign_streams import RecordedStream, read_streams
from labcrane.recording.paths import parts
from labcrane.streams.recorder.handle import SPARES, RecorderHandle
from labcrane.streams.request import StreamRequest

RATE_HZ = 500.0
BOTH_S = 1.0
"""What the death of both recorders at once may cost, in seconds of samples."""


def counts_of(stream: RecordedStream) -> np.ndarray:
    if stream.texts:
        return np.array([int(row[0]) for row in stream.texts])
    return stream.data[:, 0].astype(int)


def recording(process: psutil.Process) -> bool:
    """Whether a recorder has written samples of every stream."""
    files = [file.path for file in process.open_files() if file.path.endswith(".xdf")]
    return bool(files) and len(read_streams([Path(files[0])])[0]) == 3 and all(
        len(stream.time_raw) for stream in read_streams([Path(files[0])])[0]
    )  # fmt: skip


def loaded(spare: ProcessHandle) -> bool:
    """Whether a recorder that waits has loaded all it needs: liblsl comes last."""
    return any("liblsl" in each.path for each in psutil.Process(spare.pid).memory_maps())


def kill_at_random(folder: Path, kills: int, seed: int) -> tuple[list[float], list[str]]:
    """Kill recorders, every third time both; return what each double kill cost, in seconds."""
    source = unique("device")
    draw = random.Random(seed)
    journal = folder / "ses-01_streams.xdf"
    witnesses = [folder / "one.jsonl", folder / "other.jsonl"]
    requests = [StreamRequest(name, name=name, source_id=f"{source}/{name}") for name in NAMES]
    doubles: list[float] = []
    with (
        program("counting_device.py", source, str(RATE_HZ), into=folder / "device"),
        program("counting_witness.py", source, into=witnesses[0]),
        program("counting_witness.py", source, into=witnesses[1]),
    ):
        handle = RecorderHandle(journal, requests)
        try:

            def look(until) -> None:
                deadline = time.monotonic() + 240.0
                while not until():
                    assert time.monotonic() < deadline, handle.status
                    handle.watch()
                    time.sleep(0.02)

            for kill in range(kills):
                victims = [psutil.Process(one.pid) for one in handle._recorders]
                look(lambda: all(recording(one) for one in victims))  # noqa: B023
                look(lambda: sum(map(loaded, handle._spares)) == SPARES)
                ends = time.monotonic() + draw.uniform(0.0, 0.7)
                look(lambda: time.monotonic() > ends)  # noqa: B023
                both = kill % 3 == 2
                for victim in victims if both else [draw.choice(victims)]:
                    victim.kill()
                if both:
                    doubles.append(time.perf_counter())
                replaced = handle.restarts + 1 + both
                look(lambda: handle.restarts >= replaced)  # noqa: B023
            look(lambda: all(recording(psutil.Process(one.pid)) for one in handle._recorders))
        finally:
            handle.stop()
    streams = {stream.header.name: stream for stream in read_streams(parts(journal))[0]}
    assert sorted(streams) == sorted(NAMES)
    seen = [witnessed(path) for path in witnesses]
    costs: list[float] = []
    for name, stream in streams.items():
        counts = counts_of(stream)
        assert (np.diff(counts) > 0).all(), f"{name}: a sample twice, or out of order"
        assert (np.diff(stream.time_raw) > 0).all()
        both_saw = seen[0][name] & seen[1][name]
        between = {count for count in both_saw if counts[0] <= count <= counts[-1]}
        lost = np.array(sorted(between - set(counts.tolist())))
        rate = RATE_HZ / 10 if name == "Keys" else RATE_HZ
        if len(lost):
            holes = np.split(lost, np.flatnonzero(np.diff(lost) > 1) + 1)
            assert len(holes) <= len(doubles), f"{name}: lost {[len(hole) for hole in holes]}"
            costs += [len(hole) / rate for hole in holes]
            for hole in holes:  # only where both had died
                before = stream.time_raw[counts < hole[0]][-1]
                after = stream.time_raw[counts > hole[-1]][0]
                assert any(before <= died <= after for died in doubles)
        assert len(stream.starts) <= 1 + len(doubles)
    return costs, [path.name for path in parts(journal)]


NAMES = ("Single", "Chunked", "Keys")


@pytest.mark.parametrize(
    ("kills", "seed"),
    [pytest.param(12, 1, marks=pytest.mark.long), pytest.param(60, 2, marks=pytest.mark.soak)],
)
def test_a_killed_recorder_costs_no_sample_and_two_at_once_at_most_a_second(
    tmp_path: Path, record_property: Callable[[str, object], None], kills: int, seed: int
) -> None:
    costs, files = kill_at_random(tmp_path, kills, seed)
    record_property("seconds lost with both recorders", sorted(costs))
    assert len(files) > kills
    assert max(costs, default=0.0) <= BOTH_S
