"""The tone on a JACK server: missed blocks are counted, and in real time there are none."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from jack_server import a_jack_server, underruns
from needs import needs
from programs import ran

from labcrane_sonification import real_time
from labcrane_sonification.underruns import WINDOW, Underruns

PERIOD_S = 1024 / 48000
needs_jack = needs("jackd")
needs_real_time = needs("real-time priorities")


def counted(begun: np.ndarray) -> int:
    """Return how many blocks were missed when blocks were begun at these times, in periods."""
    found = Underruns(PERIOD_S)
    for moment in begun:
        found.begun(1000.0 + PERIOD_S * moment)
    return found.missed


@pytest.mark.parametrize("late", [0.0, 0.5, 0.9])
def test_a_block_that_is_late_by_less_than_a_period_is_not_missed(late: float) -> None:
    generator = np.random.default_rng(1)
    assert counted(np.arange(5000) + generator.uniform(0.0, late, 5000)) == 0


@pytest.mark.parametrize("ppm", [-500.0, 500.0])
def test_a_server_with_another_clock_misses_nothing(ppm: float) -> None:
    generator = np.random.default_rng(2)
    moments = np.arange(200_000) * (1.0 + 1e-6 * ppm)
    assert counted(moments + generator.uniform(0.0, 0.5, 200_000)) == 0


@pytest.mark.parametrize("catching_up", [0, 1, 2])
def test_every_whole_period_of_waiting_is_a_missed_block(catching_up: int) -> None:
    # Held up by 5.5 periods, a server may begin one or two blocks at once before the next is due.
    moments = [float(number) for number in range(200)]
    for hold in range(3):
        after = 205.5 + 100 * hold
        moments += [after, *(after + 0.01 * (n + 1) for n in range(catching_up))]
        moments += [float(number) for number in range(206 + 100 * hold, 300 + 100 * hold)]
    assert counted(np.array(moments)) == 3 * 5


def test_a_chain_that_takes_longer_than_a_block_misses_every_block_it_falls_behind() -> None:
    seconds = 2000
    made = counted(np.arange(round(seconds / 1.25)) * 1.25)
    # The clock of the server is found anew in every window, and what was late by then is forgiven.
    assert 0.25 - 1.0 / WINDOW <= made / (seconds / 1.25) <= 0.25


def played(folder: Path, seconds: float, *how: str, real_time: bool) -> dict[str, float]:
    """Play a tone on a server of its own; return what came of it."""
    program = Path(__file__).with_name("play_tone.py")
    with a_jack_server(folder, real_time=real_time) as (name, log):
        done = ran(
            [sys.executable, str(program), str(seconds), *how], env={"JACK_DEFAULT_SERVER": name}
        )
    assert done.returncode == 0, done.stderr
    return {**json.loads(done.stdout.splitlines()[-1]), "underruns": len(underruns(log))}


@pytest.mark.slow
@needs_jack
def test_blocks_that_nobody_could_compute_are_counted_here_and_by_the_server(
    tmp_path: Path,
) -> None:
    result = played(tmp_path, 2.5, "holding", real_time=False)
    assert result["holds"] >= 2
    assert result["missed"] >= 4 * result["holds"]
    assert result["underruns"] >= result["holds"]
    assert result["scheduling"] == "ordinary"
    assert not result["real time"]


@pytest.mark.slow
@needs_jack
@needs_real_time
def test_a_real_time_server_is_followed_and_left_again(tmp_path: Path) -> None:
    # That no block is missed on a busy computer is measured by benchmarks.beside.
    result = played(tmp_path, 1.0, real_time=True)
    assert result["played"] > 0
    assert result["scheduling"] == "real time"
    assert result["real time"]
    assert result["ordinary again"]


def test_a_user_who_may_not_follow_jack_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(real_time, "others_are_real_time", lambda: True)
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert real_time.follow() == "ordinary, only JACK's is real time"


LOOK = """
from labcrane_sonification.examination import examine
from labcrane_sonification.settings import SonificationSettings
for finding in examine(SonificationSettings(driver="jack", block=1024), None):
    print(finding.verdict, finding.text)
"""


@pytest.mark.slow
@needs_jack
@pytest.mark.parametrize("how", ["ordinary", pytest.param("real time", marks=needs_real_time)])
def test_the_doctor_says_whether_jack_runs_in_real_time(tmp_path: Path, how: str) -> None:
    with a_jack_server(tmp_path, real_time=how == "real time") as (name, _):
        done = ran([sys.executable, "-c", LOOK], env={"JACK_DEFAULT_SERVER": name})
    assert done.returncode == 0, done.stderr
    block, scheduling = done.stdout.splitlines()[-2:]
    assert block == "WARN the JACK server takes 48000 Hz in blocks of 1024 samples: 21.3 ms each"
    if how == "real time":
        assert scheduling == "PASS the JACK server runs in real time"
    else:
        assert scheduling.startswith("WARN the JACK server does not run in real time: it misses")
