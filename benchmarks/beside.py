"""Ticks and sound under load: misbehaving clients, a laboratory's streams, busy cores.

    python -m benchmarks.beside

The loop's lateness is that of the ticks of a real-time session, alternately with and without the
load. "Not noticed" means that 99 % of ticks are late by at most a quarter of a tick more. Missed
blocks of sound on a busy computer are compared with those during which the computer itself stopped,
as a program with a higher priority measured it. The sound needs jackd and real-time priorities.
Nothing leaves this computer.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.table import Row, dumped, loaded, show
from labcrane import open_recording
from labcrane.streams.network import LOOPBACK

TESTS = Path(__file__).parents[1] / "tests"
RATE_HZ = 240.0
QUARTER_MS = 250.0 / RATE_HZ
SPELL_S, SPELLS, RECONNECTS = 0.7, 10, 20
"""How long a spell is, how many of each kind there are, and the connections in one."""

SECONDS, BRIEF_S = 30, 5
PERIOD_S = 1024 / 48000


def rows(*, brief: bool = False) -> list[Row]:
    """Return all figures, from a separate process with its own network settings of liblsl."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.beside", "--json", *(["--brief"] if brief else [])],
        check=True, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    return loaded(done.stdout.splitlines()[-1])


def measure(folder: Path, *, brief: bool) -> list[Row]:
    """Measure here."""
    spells, seconds = (1, BRIEF_S) if brief else (SPELLS, SECONDS)
    return [*clients(folder, spells), laboratory(folder, seconds), sound(folder, seconds)]


def late_ms(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return when ticks were due, in s, and how late they were, in ms."""
    loop = open_recording(path).session(1).streams["loop"].data
    due = loop["due"].to_numpy()
    return due, 1e3 * (loop["woke"].to_numpy() - due)


def clients(folder: Path, count: int) -> list[Row]:
    """Let clients reconnect and never read, in turns with quiet spells."""
    from faults.sessions import unique, wait_for  # noqa: PLC0415 - needs the path
    from pages.room import STUDY, a_room  # noqa: PLC0415
    from pages.test_rights import cookie_of, socket_request  # noqa: PLC0415

    protocol = folder / "study.yaml"
    steps = "      - break: {seconds: 60}\n"
    protocol.write_text(STUDY.format(study=unique("clients"), steps=steps))
    spells: dict[str, list[tuple[float, float]]] = {"quiet": [], "rude": []}
    used = dict.fromkeys(spells, 0.0)
    with a_room(protocol, folder / "clients") as room:
        wait_for(lambda: room.process("pages"))
        session = room.process("session")
        cookie = cookie_of(room, "supervisor")
        request = socket_request(room, cookie).decode()
        words = [request, cookie, str(RECONNECTS), str(SPELL_S)]
        program = [sys.executable, str(TESTS / "pages" / "rude.py"), str(room.port), *words]
        with subprocess.Popen(
            program, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as client:
            assert client.stdin is not None
            assert client.stdout is not None
            for _ in range(count):
                for kind, times in spells.items():
                    before, began = sum(session.cpu_times()[:2]), time.perf_counter()
                    if kind == "rude":
                        client.stdin.write("go\n")
                        client.stdin.flush()
                        client.stdout.readline()
                    else:
                        time.sleep(SPELL_S)
                    times.append((began, time.perf_counter()))
                    used[kind] += sum(session.cpu_times()[:2]) - before
            client.stdin.close()
        room.ended()
    due, late = late_ms(room.folder / "P001-PILOT.h5")
    usual = {
        kind: float(np.median([np.quantile(late[(due >= a) & (due < b)], 0.99) for a, b in times]))
        for kind, times in spells.items()
    }
    share = {kind: used[kind] / sum(b - a for a, b in times) for kind, times in spells.items()}
    what = "99 % of ticks late by at most, with rude clients, ms"
    reference = "without, and a quarter of a tick"
    return [
        Row("beside", what, usual["rude"], usual["quiet"] + QUARTER_MS, reference, 0.6),
        Row(
            "beside", "the session's share of a core, with rude clients", share["rude"],
            share["quiet"], "without", 1.25,
        ),
    ]  # fmt: skip


def laboratory(folder: Path, length: int) -> Row:
    """Run sessions with and without recording of 64 channels at 1 kHz, gaze and markers."""
    from faults.sessions import labcrane, unique  # noqa: PLC0415
    from faults.test_load import NEEDS, a_study  # noqa: PLC0415

    word = unique("beside")
    program = [sys.executable, str(TESTS / "faults" / "laboratory.py"), word]
    devices = subprocess.Popen(
        [*program, str(2 * length)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    usual = {}
    try:
        assert devices.stdin is not None
        assert devices.stdout is not None
        devices.stdout.readline()
        devices.stdin.write("go\n")
        devices.stdin.flush()
        for name, needs in (("P001", NEEDS.format(word=word)), ("P002", "")):
            study = a_study(folder / f"{name}.yaml", length, needs)
            data = folder / "laboratory"
            run = labcrane("run", study, "--participant", name, "--simulate", "--data", data)
            said, _ = run.communicate()
            assert run.returncode == 0, said
            _, late = late_ms(data / f"{name}-SIMULATED" / f"{name}-SIMULATED.h5")
            seconds = late[: len(late) // 240 * 240].reshape(-1, 240)
            usual[name] = float(np.median(np.quantile(seconds, 0.99, axis=1)))
    finally:
        devices.kill()
        devices.communicate()
    what = "99 % of ticks late by at most, while 64 channels at 1 kHz are recorded, ms"
    bare = usual["P002"] + QUARTER_MS
    return Row("beside", what, usual["P001"], bare, "without, and a quarter of a tick", 0.6)


def sound(folder: Path, length: float) -> Row:
    """Play a session's sound in real time while every core is kept busy."""
    from busy_computer import crowded_computer  # noqa: PLC0415
    from faults.jack_session import a_jack_session  # noqa: PLC0415
    from faults.sessions import unique  # noqa: PLC0415
    from faults.test_sound_session import STUDY, Ending  # noqa: PLC0415

    (folder / "sound").mkdir()
    study = STUDY.format(study=unique("sound"))
    with crowded_computer() as standstill:
        session, _ = a_jack_session(study, folder / "sound", Ending(length), real_time=True)
    heard = session.streams["labcrane.feedback.tone"].data
    missed = float(heard["tone.missed"].iloc[-1])
    stood = float(np.ceil(standstill.total_s / PERIOD_S))
    what = f"blocks missed in {length:g} s of sound on a busy computer, and one"
    return Row("beside", what, 1.0 + missed, 1.0 + stood, "for which it stood still, and one", 1.0)


def main() -> None:
    """Measure everything, and print it for people or for the calling process."""
    sys.path[:0] = [str(TESTS), str(TESTS / "helpers")]
    with tempfile.TemporaryDirectory(prefix="labcrane-beside-") as name:
        folder = Path(name)
        config = folder / "lsl_api.cfg"
        config.write_text(LOOPBACK.replace("[lab]", f"[lab]\nSessionID = beside-{os.getpid()}"))
        os.environ["LSLAPICFG"] = str(config)
        found = measure(folder, brief="--brief" in sys.argv)
    show(found)
    if "--json" in sys.argv:
        print(dumped(found))


if __name__ == "__main__":
    main()
