"""Whole studies without people: the same files whoever makes them, and however often."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from dying_work import die_once
from simple_crane import CRANE

from labcrane import LabcraneError, ProtocolError, RecordingError, open_recording
from labcrane.simulation.simulation import SimulationJob, simulate, simulate_study
from labcrane.testing import main

STUDY = (
    """\
labcrane: 1
study: rehearsal
title: Few movements
participants: {pattern: 'P\\d{3}', planned: 6}
rate_hz: 60
"""
    + CRANE
    + """\
tasks:
  aiming: {use: aiming, distances: [2, 4], movements: 2}
design:
  groups: {none: [], slow: []}
  order: {pairs: shuffled}
sessions:
  - {name: one, steps: [{block: {task: aiming, pairs: 2}}]}
  - {name: two, steps: [{block: {task: aiming, pairs: 1}}]}
"""
)
COHORT = """\
labcrane_cohort: 1
operator:
  learning_rate: {median: 0.1, log_sd: 0.4}
  reaction_s: {lowest: 0.3, highest: 0.5}
groups:
  slow: {fitts_b_s: 2.0}
"""
NAMES = ("P001", "P002", "P003", "P004", "P005", "P006")


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = tmp_path / "study" / "protocol.yaml"
    path.parent.mkdir()
    path.write_text(STUDY)
    return path


@pytest.fixture
def cohort(study: Path) -> Path:
    path = study.with_name("cohort.yaml")
    path.write_text(COHORT)
    return path


def orders(study: Path, cohort: Path | None, data: Path, names: tuple[str, ...] = NAMES):
    return [SimulationJob(study, cohort, data, name) for name in names]


def digests(folder: Path) -> dict[str, str]:
    """Return the hash of every file, by its path in the folder; of HDF5, of what it holds.

    The library that packs HDF5's chunks sometimes packs the same bits in another way.
    """
    return {
        str(path.relative_to(folder)): hashlib.sha256(
            held(path) if path.suffix == ".h5" else path.read_bytes()
        ).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def held(path: Path) -> bytes:
    """Return all that an HDF5 file holds: names, attributes, shapes, types and bits."""
    import h5py

    parts: list[object] = []

    def see(name: str, node: h5py.Group | h5py.Dataset) -> None:
        parts.append((name, sorted((key, str(value)) for key, value in node.attrs.items())))
        if isinstance(node, h5py.Dataset):
            values = node[()]
            parts.append((node.shape, str(node.dtype), values.tobytes()))

    with h5py.File(path) as file:
        see("/", file)
        file.visititems(see)
    return repr(parts).encode()


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What one process makes of the study."""
    folder = tmp_path_factory.mktemp("local")
    (folder / "protocol.yaml").write_text(STUDY)
    (folder / "cohort.yaml").write_text(COHORT)
    data = folder / "data"
    list(simulate_study(orders(folder / "protocol.yaml", folder / "cohort.yaml", data)))
    return digests(data)


@pytest.mark.slow
def test_a_simulation_leaves_the_files_of_a_study_all_stamped(
    study: Path, cohort: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", str(study), "--out", str(tmp_path / "data")]) == 0
    assert "SIMULATED: 6 participants" in capsys.readouterr().out
    for name in NAMES:
        folder = tmp_path / "data" / f"{name}-SIMULATED"
        left = sorted(path.name for path in folder.iterdir())
        files = [f"{name}-SIMULATED.h5", "ses-01_run.xdf", "ses-02_run.xdf"]
        assert left == [*files, "simulated_by.json"]
        recording = open_recording(folder / left[0])
        assert list(recording.sessions) == [1, 2]
        for number in (1, 2):
            session = recording.session(number)
            assert session.attrs["simulated"] == "yes"
            assert len(session.trials) == 4 / number


@pytest.mark.slow
def test_two_cores_make_the_same_bits_as_one(
    study: Path, cohort: Path, tmp_path: Path, local: dict[str, str]
) -> None:
    list(simulate_study(orders(study, cohort, tmp_path / "data"), workers=2))
    assert digests(tmp_path / "data") == local


@pytest.mark.long
def test_an_interrupted_simulation_goes_on_and_keeps_who_is_there(
    study: Path, cohort: Path, tmp_path: Path, local: dict[str, str]
) -> None:
    data = tmp_path / "data"
    list(simulate_study(orders(study, cohort, data, NAMES[:5])))
    kept = data / "P001-SIMULATED" / "P001-SIMULATED.h5"
    before = kept.stat().st_mtime_ns
    left_by_a_kill = data / ".unfinished" / "P006-half" / "P006-SIMULATED"
    left_by_a_kill.mkdir(parents=True)
    (left_by_a_kill / "ses-01_run.xdf").write_bytes(b"XDF:")
    found = list(simulate_study(orders(study, cohort, data)))
    assert [folder.participant for folder in found] == list(NAMES)
    assert kept.stat().st_mtime_ns == before
    assert digests(data) == local


def begun(data: Path, count: int) -> None:
    """Wait until so many participants are there."""
    deadline = time.monotonic() + 240
    while len(list(data.glob("P*"))) < count:
        assert time.monotonic() < deadline
        time.sleep(0.005)


@pytest.mark.long
@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupt_by_hand_says_who_is_there_and_the_same_command_makes_the_others(
    study: Path, cohort: Path, tmp_path: Path, local: dict[str, str], workers: int
) -> None:
    data = tmp_path / "data"
    words = ["simulate", str(study), "--out", str(data), "--workers", str(workers)]
    words += ["--participants", "40"]
    command = [sys.executable, "-m", "labcrane", *words]
    going = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    with subprocess.Popen(command, start_new_session=True, **going) as program:
        begun(data, 1)
        os.killpg(program.pid, signal.SIGINT)  # as a terminal does, to workers too
        said = " ".join(program.communicate(timeout=240)[0].split())
    assert program.returncode == 128 + signal.SIGINT, said
    there = len(list(data.glob("P*")))
    assert 1 <= there < 40
    assert f"interrupted: {there} of 40 participants are complete in {data}; run the same" in said
    assert "Traceback" not in said
    assert main([*words[:-1], "6"]) == 0
    first = {path: each for path, each in digests(data).items() if path[:4] in NAMES}
    assert first == {path: each for path, each in local.items() if path[:4] in NAMES}


@pytest.mark.slow
def test_another_population_is_not_mixed_into_a_folder(
    study: Path, cohort: Path, tmp_path: Path
) -> None:
    data = tmp_path / "data"
    list(simulate_study(orders(study, cohort, data, NAMES[:1])))
    with pytest.raises(ProtocolError, match="holds a simulation with another cohort; give a new"):
        list(simulate_study(orders(study, None, data)))


def test_two_simulations_do_not_share_a_folder(study: Path, tmp_path: Path) -> None:
    import fcntl

    data = tmp_path / "data"
    data.mkdir()
    fd = os.open(data, os.O_RDONLY)
    fcntl.flock(fd, fcntl.LOCK_EX)
    with pytest.raises(RecordingError, match="another labcrane process is working"):
        list(simulate_study(orders(study, None, data)))
    os.close(fd)


@pytest.mark.slow
def test_a_participant_who_leaves_has_no_later_session(study: Path, tmp_path: Path) -> None:
    cohort = study.with_name("leaving.yaml")
    cohort.write_text("labcrane_cohort: 1\ndropout: 1.0\n")
    folder = simulate(SimulationJob(study, cohort, tmp_path, "P001"))
    recording = open_recording(folder.participant_file)
    assert list(recording.sessions) == [1]
    ends = recording.session(1).events.query("name == 'session.end'")
    assert ends.iloc[-1]["data"]["reason"] == "by order"


def test_work_of_a_core_that_was_lost_is_done_again(tmp_path: Path) -> None:
    from labcrane.analysis.parallel import work

    given = [(tmp_path / "mark", number) for number in range(4)]
    assert sorted(work(die_once, given, workers=2)) == [0, 1, 2, 3]
    assert (tmp_path / "mark").exists()


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from labcrane.analysis.parallel import work

    monkeypatch.setattr("labcrane.analysis.parallel.CONNECT_S", 1.0)
    with pytest.raises(LabcraneError, match=r"no Dask scheduler answers at 'tcp://127\.0\.0\.1:1'"):
        list(work(die_once, [(Path(), 0)], scheduler="tcp://127.0.0.1:1"))


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Start a Dask scheduler and two workers as processes; yield address and workers."""
    file = folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    where = ["--host", "127.0.0.1", "--no-dashboard"]
    running = []

    def start(kind: str, *more: str) -> subprocess.Popen[bytes]:
        words = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *where, *more]
        running.append(subprocess.Popen(words, cwd=folder, **quiet))
        return running[-1]

    try:
        start("scheduler", "--port", "0", "--scheduler-file", str(file))
        deadline = time.monotonic() + 240.0
        while not file.exists() or not file.read_text():
            assert time.monotonic() < deadline, "the scheduler does not start"
            time.sleep(0.05)
        address = json.loads(file.read_text())["address"]
        options = ("--nthreads", "1", "--nworkers", "1", "--no-nanny", "--local-directory")
        workers = [start("worker", address, *options, str(folder / str(n))) for n in (1, 2)]
        yield address, workers
    finally:
        for process in running:
            process.kill()
            process.wait()


@pytest.mark.long
def test_a_cluster_makes_the_same_bits_even_when_a_worker_is_killed(
    study: Path, cohort: Path, tmp_path: Path, local: dict[str, str]
) -> None:
    data = tmp_path / "data"
    with cluster(tmp_path) as (address, workers):
        making = simulate_study(orders(study, cohort, data), scheduler=address)
        next(making)
        while len(list((data / ".unfinished").iterdir())) < len(workers):
            time.sleep(0.005)
        workers[0].kill()  # in the middle of a participant, as the other one is
        done = list(making)
        assert workers[0].wait(240) == -signal.SIGKILL
    assert len(done) == len(NAMES) - 1
    assert digests(data) == local


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [pytest.param(["report"], marks=pytest.mark.long), ["export", "--to", "tables"]],
    ids=" ".join,
)
def test_two_cores_report_and_export_the_same(
    study: Path, cohort: Path, tmp_path: Path, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    data = tmp_path / "data"
    list(simulate_study(orders(study, cohort, data, NAMES[:3])))
    for workers in ("1", "2"):
        where = ["--out", str(tmp_path / workers), "--include", "simulated", "--workers", workers]
        assert main([words[0], str(data), *where, *words[1:]]) == 0
    one, two = (
        {name: each for name, each in digests(tmp_path / workers).items() if name.endswith(".csv")}
        for workers in ("1", "2")
    )
    assert one == two
    assert len(one) > 2
    assert set(digests(tmp_path / "1")) == set(digests(tmp_path / "2"))


@contextmanager
def killed_at_work(
    address: str, workers: "Sequence[subprocess.Popen[bytes]]"
) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Kill the first worker that has something to do; say which that was."""
    from distributed import Client

    killed: list[subprocess.Popen[bytes]] = []
    ready, over = threading.Event(), threading.Event()

    def watch() -> None:
        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(len(workers))
            whose = {pid: where for where, pid in client.run(os.getpid).items()}
            ready.set()
            while not over.is_set():
                busy = client.processing()
                for worker in workers:
                    if busy.get(whose[worker.pid]):
                        killed.append(worker)
                        worker.kill()
                        return

    watching = threading.Thread(target=watch)
    watching.start()
    try:
        assert ready.wait(240)
        yield killed
    finally:
        over.set()
        watching.join()


@pytest.mark.long
@pytest.mark.parametrize("command", ["power", "report", "export"])
def test_a_cluster_does_what_one_process_does_even_when_a_worker_is_killed(
    study: Path, cohort: Path, tmp_path: Path, command: str
) -> None:
    """Real processes: the worker dies while it has work, and its work is done by the other one."""
    data = tmp_path / "data"
    if command != "power":
        list(simulate_study(orders(study, cohort, data)))
    words = {
        "power": ["power", str(study), "--participants", "4", "--pool", "6", "--cohorts", "60",
                  "--test", "contrast", "--effect", "movement_time~group[none,slow]=1"],
        "report": ["report", str(data), "--include", "simulated"],
        "export": ["export", str(data), "--include", "simulated", "--to", "tables"],
    }[command]  # fmt: skip
    assert main([*words, "--out", str(tmp_path / "one")]) == 0
    for kept in data.rglob("*.parquet"):
        kept.unlink()  # of measures: they are to be worked out again
    with (
        cluster(tmp_path) as (address, workers),
        killed_at_work(address, workers) as killed,
    ):
        assert main([*words, "--out", str(tmp_path / "two"), "--scheduler", address]) == 0
    assert [worker.wait(240) for worker in killed] == [-signal.SIGKILL]
    one, two = (
        {name: each for name, each in digests(tmp_path / where).items() if name.endswith(".csv")}
        for where in ("one", "two")
    )
    assert one == two
    assert one
