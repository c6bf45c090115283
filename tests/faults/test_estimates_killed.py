"""A session with an estimate of a stream of another clock, which is killed, stopped and resumed."""

import re
from collections.abc import Iterator

import numpy as np
import pandas as pd
import pytest
from faults.sessions import labcrane, session_process, unique, wait_for
from simple_crane import CRANE
from streams.emulation import Lab, Skew, build

from labcrane import open_recording

STUDY = (
    """\
labcrane: 1
study: estimates
title: A study with an estimate
rate_hz: 240
"""
    + CRANE
    + """\
streams:
  eeg: {name: DEVICE}
estimates:
  truth: {use: truth, stream: eeg, fallback: {sampled: -1}}
  broken: {use: broken, stream: eeg, fallback: {sampled: -1}}
tasks:
  aiming: {use: aiming, distances: [1], movements: 4, limit_s: 8}
sessions:
  - {name: only, steps: [{block: {task: aiming, pairs: 1}}]}
on_fault: {session_died: redo_trial, stream_lost: mark}
"""
)
PLUGIN = '''\
from typing import ClassVar

from labcrane import Estimate, hookimpl, offer
from labcrane.core import Estimated, EstimateSettings

labcrane_api = 1


class TruthSettings(EstimateSettings):
    values: ClassVar = ("sampled",)


class Truth(Estimate):
    """The true time of the newest sample, which the device sends: each sample is a step."""

    def __init__(self, settings):
        pass

    def begin(self, stream):
        pass

    def update(self, times, samples):
        return Estimated(float(times[-1]), float(times[0]), (float(samples[-1, 0]),))


class Broken(Truth):
    def update(self, times, samples):
        raise RuntimeError("no electrode is on")


@hookimpl
def labcrane_estimates():
    return [offer("truth", TruthSettings, Truth), offer("broken", TruthSettings, Broken)]
'''


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[object]:
    folder = tmp_path_factory.mktemp("estimates")
    name = unique("amplifier")
    lab = Lab(folder, build(folder))
    protocol, data = folder / "study.yaml", folder / "data"
    protocol.write_text(STUDY.replace("DEVICE", name))
    (folder / "plugins").mkdir()
    (folder / "plugins" / "truth.py").write_text(PLUGIN)
    who = ("--participant", "P001", "--simulate", "--data", data)
    device = lab.device(name, Skew(), rate=250.0)
    launcher = labcrane("run", protocol, *who)
    lab.processes.append(launcher)
    try:
        journal = data / "P001-SIMULATED" / "ses-01_run.xdf"
        wait_for(lambda: journal.exists() and journal.stat().st_size > 8.0 * 240 * 8 * 75)
        victim = session_process(launcher)
        assert victim is not None
        victim.kill()
        launcher.communicate(timeout=240)
        resumed = labcrane("resume", protocol, *who)
        lab.processes.append(resumed)
        second = journal.with_name("ses-01_run.part2.xdf")
        wait_for(lambda: second.exists() and second.stat().st_size > 4.0 * 240 * 8 * 75)
        device.kill()
        said = resumed.communicate(timeout=240)[0]
        assert resumed.returncode == 0, said
        yield open_recording(data / "P001-SIMULATED" / "P001-SIMULATED.h5").session(1)
    finally:
        lab.close()


def used(session) -> pd.DataFrame:
    """Return the ticks in which the estimate had a value."""
    frames = session.streams["input"].data
    own = frames.filter(regex=r"^estimate\.truth\.").rename(columns=lambda c: c.rpartition(".")[2])
    own["due"] = session.streams["loop"].data["due"].to_numpy()
    return own[own["state"] == 0.0]


@pytest.mark.slow
def test_a_value_is_used_soon_and_its_time_is_that_of_its_sample(session) -> None:
    ticks = used(session)
    assert len(ticks) > 500
    wrong = np.abs(ticks["sampled"] - ticks["time"])
    assert np.quantile(wrong, 0.99) < 0.005
    first = ticks[ticks["sampled"].diff() != 0.0]
    assert np.quantile(first["due"] - first["sampled"], 0.99) < 0.25


@pytest.mark.slow
def test_each_tick_without_a_value_has_the_fallback_and_each_change_is_an_event(session) -> None:
    frames = session.streams["input"].data
    state = frames["estimate.truth.state"].to_numpy()
    assert set(frames["estimate.truth.sampled"][state != 0.0]) == {-1.0}
    told = session.events[session.events["name"].isin(["estimate.lost", "estimate.back"])]
    told = told[[data["estimate"] == "truth" for data in told["data"]]]
    assert told["name"].iloc[-1] == "estimate.lost", "the amplifier was switched off"
    assert told["data"].iloc[-1]["state"] == "no_data"
    assert state[-1] == 2.0


@pytest.mark.slow
def test_the_record_says_why_the_process_of_an_estimate_failed_and_in_which_line(session) -> None:
    failed = session.events[session.events["name"] == "estimate.failed"]
    why = re.compile(
        r"failed: RuntimeError: no electrode is on \(.*/truth\.py:\d+\); it is started again"
    )
    assert len(failed) >= 2, "and again after a restart"
    assert all(data["estimate"] == "broken" for data in failed["data"])
    assert any(why.fullmatch(data["why"]) for data in failed["data"])
    restarts = {
        one["name"].removeprefix("labcrane.estimate."): one["quality"]["restarts"]
        for one in session.sync_report["streams"]
    }
    assert restarts["broken"] > 0


@pytest.mark.slow
def test_the_recorder_has_every_value_that_was_used(session) -> None:
    recorded = session.streams["labcrane.estimate.truth"].data
    ticks = used(session)
    assert set(ticks["sampled"]) <= set(recorded["sampled"])


@pytest.mark.slow
def test_the_stream_of_values_says_by_how_much_its_times_may_be_off(session) -> None:
    stream = session.streams["labcrane.estimate.truth"]
    valued = stream.data["sampled"].notna().to_numpy()
    wrong = np.abs(stream.time - stream.data["sampled"].to_numpy())[valued]
    assert valued.sum() > 100
    assert np.mean(wrong <= stream.data["clock"][valued]) >= 0.95
    (judged,) = (
        one for one in session.sync_report["streams"] if one["name"] == "labcrane.estimate.truth"
    )
    assert judged["quality"]["unprobed"] == 0, "also of the one that was started again"
    exact = judged["quality"]["error_p95_s"] < 1e-3  # probes of a busy computer leave more open
    assert (judged["verdict"] == "PASS") is exact, judged["findings"]
