"""Estimates in whole sessions: their columns, their states, and a share that follows one."""

import math
from pathlib import Path

import numpy as np
import pytest
from rehearsal import ScriptedConsole, a_study, rehearse
from simple_crane import CRANE

from labcrane import FloatArray, ProtocolError, open_recording
from labcrane.analysis import Participant
from labcrane.analysis.cohort import Status
from labcrane.analysis.quality import estimates_quality
from labcrane.protocol import estimated, rig
from labcrane.protocol.estimated import WORDS, State, WithEstimates
from labcrane.protocol.questions import questions
from labcrane.protocol.streams import StreamNeed
from labcrane.replay import replay_session
from labcrane.testing import Command, Order, Visit, discover, load, run
from labcrane_estimates.settings import BandPowerSettings

SHARE = "{estimate: load.ratio, between: [1, 3], to: [0, 0.8], at_most_per_s: 0.5}"
STUDY = (
    """\
labcrane: 1
study: adaptive
title: A share that follows an estimate
rate_hz: 60
"""
    + CRANE
    + """\
assist: {use: toward_target, share: SHARE}
streams:
  eeg: {name: Amplifier}
estimates:
  load: {use: band_power, stream: eeg, channels: [Fz], per_channels: [Pz], fallback: {ratio: 2}}
tasks:
  aiming: {use: aiming, distances: [1, 2], movements: 2, limit_s: 20}
sessions:
  - {name: only, steps: [{block: {task: aiming, pairs: 1}}]}
"""
)


def text(share: str = SHARE) -> str:
    return STUDY.replace("SHARE", share)


class Scripted:
    """Gives a ratio of 3 and, a second in four, each of the states without a value."""

    STATES = (State.OK, State.LATE, State.OK, State.NOT_A_NUMBER)

    def __init__(self, *_: object) -> None:
        pass

    def fill(self, out: FloatArray, now: float) -> None:
        state = self.STATES[int(now) % len(self.STATES)]
        if state is State.OK:
            out[0] = 3.0
        out[-2:] = now - 0.1, state

    def close(self) -> None:
        pass


def recorded(folder: Path, written: str) -> Path:
    folder.mkdir(exist_ok=True)
    visit = Visit(a_study(folder, written), "P001", 1, folder / "data", simulated=True, fast=True)
    return run(visit, ScriptedConsole())


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(estimated, "Received", Scripted)
    monkeypatch.setattr(rig, "WithEstimates", lambda *given: WithEstimates(*given[:2], "any"))


@pytest.mark.parametrize("name", ["adaptive_assist", "adaptive_sphere"])
def test_the_example_has_no_warning(name: str) -> None:
    path = Path(__file__).parents[2] / "examples" / name / "protocol.yaml"
    assert list(questions(load(path, discover()))) == []


def test_without_streams_each_tick_has_the_fallback_and_says_so(tmp_path: Path) -> None:
    frames = open_recording(recorded(tmp_path, text())).session(1).streams["input"].data
    assert set(frames["estimate.load.ratio"]) == {2.0}
    assert set(frames["estimate.load.state"]) == {float(State.NO_DATA)}
    assert frames["estimate.load.time"].isna().all()


def test_each_change_of_state_is_an_event_and_the_fallback_is_in_the_same_tick(
    tmp_path: Path, scripted: None
) -> None:
    session = open_recording(recorded(tmp_path, text())).session(1)
    frames = session.streams["input"].data
    state = frames["estimate.load.state"].to_numpy()
    assert np.array_equal(frames["estimate.load.ratio"], np.where(state == 0.0, 3.0, 2.0))
    changes = np.flatnonzero(np.diff(state)) + 1
    events = session.events[session.events["name"].str.startswith("estimate.")]
    assert set(changes) <= set(events["tick"]) <= {0, *changes}
    whys = {data.get("why") for data in events["data"]}
    assert whys == {None, WORDS[State.LATE], WORDS[State.NOT_A_NUMBER]}


def test_a_value_of_a_time_to_come_is_never_used_nor_one_that_is_too_old(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A source's clock that steps, or times of another clock, do not keep a value alive."""

    class Newest:
        def __init__(self, _: object) -> None:
            pass

        def pull(self, _: int) -> tuple[list[list[float]], list[float]]:
            return ([[3.0, stamp, stamp, 0.0]], [stamp]) if (stamp := stamps.pop(0)) else ([], [])

    monkeypatch.setattr("labcrane.streams.newest.NewestSample", Newest)
    settings = BandPowerSettings(
        stream="eeg", channels=("Fz",), per_channels=("Pz",), fallback={"ratio": 2.0}
    )
    ages = (0.1, 1.9, 2.1, -0.04, -0.06, -1.8e9, 0.3)
    received = estimated.Received("load", settings, "any")
    for age in ages:
        stamps = [100.0 - age]
        out = np.array([2.0, math.nan, State.NO_DATA])
        received.fill(out, 100.0)
        state = State.LATE if age > 2.0 else State.AHEAD if age < -0.05 else State.OK
        assert out[2] == state
        assert out[0] == (3.0 if state is State.OK else 2.0)
    stamps = [0.0] * 3
    received.fill(out, 101.5)
    assert (out[0], out[2]) == (3.0, State.OK), "the newest, still young enough"
    received.fill(out := np.array([2.0, math.nan, State.NO_DATA]), 103.0)
    assert (out[0], out[2]) == (2.0, State.LATE)


def test_the_share_goes_to_where_the_value_maps_and_never_faster_than_its_limit(
    tmp_path: Path, scripted: None
) -> None:
    session = open_recording(recorded(tmp_path, text())).session(1)
    loop, frames = session.streams["loop"].data, session.streams["input"].data
    moving = ((loop["trial"] > 0) & (loop["paused"] == 0.0)).to_numpy()
    share = session.streams["command"].data["assist.share"].to_numpy()[moving]
    aim = np.where(frames["estimate.load.ratio"].to_numpy()[moving] == 3.0, 0.8, 0.4)
    expected, now = [], 0.0
    for each in aim:
        now += math.copysign(min(abs(each - now), 0.5 / 60), each - now)
        expected.append(now)
    assert share == pytest.approx(expected, abs=1e-12)
    assert share.max() == pytest.approx(0.8)


def test_a_track_chooses_by_the_mean_over_the_trial(tmp_path: Path, scripted: None) -> None:
    design = (
        "design: {tracks: {help: {factor: assist, levels: {full: 1, half: 2}, "
        "measure: load_ratio, at_most: 2.5, up_down: {reversals: 2, leave_out: 0}, "
        "rounds: 2}}}\nsessions:"
    )
    written = text("{half: 0.5, full: 1}").replace("sessions:", design)
    written = written.replace("pairs: 1}", "track: help, feedback: none}")
    session = open_recording(recorded(tmp_path, written)).session(1)
    loop, frames = session.streams["loop"].data, session.streams["input"].data
    for row in session.trials.itertuples():
        used = (loop["trial"] == row.trial) & (frames["estimate.load.state"] == 0.0)
        assert row.load_ratio == pytest.approx(frames["estimate.load.ratio"][used].mean())
    judged = session.trials["track_success"].dropna()
    assert set(judged) == {0.0}, "a mean of 3 is above 2.5 in each"
    assert set(session.trials["assist"]) == {"full"}


def test_the_latency_of_each_value_that_was_used_is_in_the_report(
    tmp_path: Path, scripted: None
) -> None:
    path = recorded(tmp_path, text())
    (row,) = estimates_quality(Participant("P001", path, Status.SIMULATED, "")).to_dict("records")
    state = open_recording(path).session(1).streams["input"].data["estimate.load.state"]
    assert row["values_used"] == (state == 0.0).sum()
    assert row["latency_median_ms"] == pytest.approx(100.0)
    assert row["latency_p99_ms"] == pytest.approx(100.0)
    assert row["fallback_share"] == pytest.approx((state != 0.0).mean())


def test_a_replay_reads_the_columns_and_gives_the_same_bits(tmp_path: Path, scripted: None) -> None:
    path = recorded(tmp_path, text())
    replayed = replay_session(path, 1)
    assert (replayed.difference, replayed.parts) == (None, ())
    other = tmp_path / "other.yaml"
    other.write_text(text(SHARE.replace("0.5", "0.4")))
    again = replay_session(path, 1, protocol=other)
    assert again.parts == ("assist.share.at_most_per_s: recorded 0.5, now 0.4",)
    assert again.difference is not None


def test_a_session_waits_for_no_stream_that_it_sends_itself() -> None:
    for name, waits in (("labcrane.codes", False), ("Amplifier", True)):
        need = StreamNeed(name=name)
        assert need.request("any", required=True).required is waits


RULES = "stop_rules: [{estimate: load.ratio, above: 2.5}, {estimate: load.ratio, below: 2}]\n"


def test_a_mean_beyond_its_limit_pauses_after_its_trial_until_the_experimenter_decides(
    tmp_path: Path, scripted: None
) -> None:
    starts = {tick: [Command(Order.START)] for tick in range(0, 20_000, 30)}
    seen = rehearse(a_study(tmp_path, text("0") + RULES), starts, waits=True)
    counted = [data["trial"] for data in seen.trials()]
    assert counted
    for met, trial in zip(seen.events("stop_rule.met"), counted, strict=True):
        expected = {"estimate": "load.ratio", "trial": trial, "above": 2.5}
        assert met.data == {**expected, "value": pytest.approx(3.0)}
    held = [event.data["by"] for event in seen.events("pause.start")]
    assert held == ["stop rule"] * len(counted)
    assert seen.names[-1] == "session.end"
    assert not seen.events("participant.dropout")


def test_a_replay_judges_rules_by_the_recorded_values(tmp_path: Path, scripted: None) -> None:
    path = recorded(tmp_path, text("0") + RULES)
    events = open_recording(path).session(1).events
    assert "stop_rule.met" in set(events["name"])
    assert "pause.start" not in set(events["name"]), "no person can decide in a simulation"
    assert replay_session(path, 1).difference is None


@pytest.mark.parametrize("state", [State.NOT_A_NUMBER, State.NO_DATA])
def test_without_any_value_a_rule_is_not_met_and_the_record_says_that_it_was_not_judged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scripted: None, state: State
) -> None:
    monkeypatch.setattr(Scripted, "STATES", (state,))
    events = open_recording(recorded(tmp_path, text("0") + RULES)).session(1).events
    assert "stop_rule.met" not in set(events["name"])
    unjudged = events.loc[events["name"] == "stop_rule.unjudged", "data"]
    trials = [data["trial"] for data in events.loc[events["name"] == "trial.end", "data"]]
    assert set(trials) >= {data["trial"] for data in unjudged}
    assert len(unjudged) == 2 * len({data["trial"] for data in unjudged}) > 0


REFUSED = {
    r"stop_rules\[1\].estimate is 'load.ration', .* did you mean 'load.ratio'": text("1")
    + "stop_rules: [{estimate: load.ration, above: 2}]\n",
    "a questionnaire and its score, or else an estimate": text("1")
    + "stop_rules: [{estimate: load.ratio, score: total, above: 2}]\n",
    "write above or below, one of them": text("1") + "stop_rules: [{estimate: load.ratio}]\n",
    r"assist.share.estimate is 'load.ration', .* no such estimate; did you mean 'load.ratio'": text(
        SHARE.replace("ratio", "ration")
    ),
    r"feedback.ball.opacity.estimate is 'lod.ratio', .* did you mean 'load.ratio'": text("1")
    + f"feedback: {{ball: {{use: sphere, opacity: {SHARE.replace('load', 'lod')}}}}}\n",
    r"assist\.share needs 'at_most_per_s'": text(SHARE.replace(", at_most_per_s: 0.5", "")),
    "between has 3 twice": text(SHARE.replace("[1, 3]", "[3, 3]")),
    "less than or equal to 1": text(SHARE.replace("0.8", "1.8")),
    "there is no single stream 'eg' under streams": text().replace("stream: eeg", "stream: eg"),
    "fallback has rate, and the values are ratio": text().replace("{ratio: 2}", "{rate: 2}"),
    "'my load' names columns": text("1").replace("  load:", "  my load:"),
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_cannot_be_estimated_is_refused(message: str, tmp_path: Path) -> None:
    with pytest.raises(ProtocolError, match=message):
        a_study(tmp_path, REFUSED[message])
