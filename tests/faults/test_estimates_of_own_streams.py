"""Estimates of the session's own streams: of the sticks, and of a detection response task."""

import numpy as np
import pytest
from faults.sessions import labcrane, unique
from simple_crane import FORM

from labcrane import open_recording
from labcrane.recording import SessionRecord

WINDOW_S, STEP_S = 2.0, 0.05

STUDY = (
    """\
labcrane: 1
study: {study}
title: A study that answers to the operator's hands
rate_hz: 240
"""
    + FORM
    + """\
operator:
  use: simulated_operator
  response: {{to: drt.stimulus, median_s: 0.2, lapse_rate: 0.1}}
tasks:
  aiming: {{use: aiming, distances: [1], movements: 3, limit_s: 8}}
secondary:
  drt: {{use: drt, interval_s: [0.8, 1.0], longest_s: 0.2, hit_s: [0.05, 0.6]}}
streams:
  sticks: {{name: labcrane.input}}
  codes: {{name: labcrane.codes}}
estimates:
  hands:
    use: stick_activity
    stream: sticks
    channels: [left.x, left.y]
    window_s: 2
    fallback: {{rms_speed: -1, moving: -1}}
  answer: {{use: drt_response, stream: codes, hit_s: [0.05, 0.6], fallback: {{response_time: -1}}}}
sessions:
  - {{name: only, steps: [{{block: {{task: aiming, pairs: 1}}}}]}}
"""
)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> SessionRecord:
    folder = tmp_path_factory.mktemp("own")
    (folder / "study.yaml").write_text(STUDY.format(study=unique("own")))
    words = ("--participant", "P001", "--simulate", "--data", folder / "data")
    run = labcrane("run", folder / "study.yaml", *words)
    try:
        said = run.communicate(timeout=240)[0]
    finally:
        run.kill()
    assert run.returncode == 0, said
    return open_recording(folder / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5").session(1)


@pytest.mark.slow
def test_the_activity_of_the_sticks_is_that_of_the_recorded_axes(
    session: SessionRecord,
) -> None:
    frames, due = session.streams["input"].data, session.streams["loop"].data["due"].to_numpy()
    used = frames[frames["estimate.hands.state"] == 0.0].drop_duplicates("estimate.hands.time")
    assert len(used) > 500
    axes, lag = frames[["left.x", "left.y"]].to_numpy(), round(STEP_S * 240)
    for _, tick in used.iloc[::50].iterrows():
        last = int(np.abs(due - tick["estimate.hands.time"]).argmin())
        assert abs(due[last] - tick["estimate.hands.time"]) < 0.002
        # On a busy computer ticks are stamped late: a few more or fewer are within the window.
        expected = []
        for count in round(WINDOW_S * 240) + np.arange(-4, 5):
            window = axes[max(last + 1 - count, 0) : last + 1]
            speed = (window[lag:] - window[:-lag]) / STEP_S
            expected.append(np.sqrt((speed**2).sum(axis=1).mean()))
        assert min(expected) - 1e-3 < tick["estimate.hands.rms_speed"] < max(expected) + 1e-3


@pytest.mark.slow
def test_the_response_time_is_the_mean_of_those_that_the_task_measured(
    session: SessionRecord,
) -> None:
    stimuli: dict[int, dict[str, object]] = {}
    for event in session.events.itertuples():
        if event.name.startswith("drt."):
            stimulus = stimuli.setdefault(event.data["stimulus"], {})
            stimulus.setdefault(event.name, event.time)
            stimulus |= {"outcome": event.data["outcome"]} if "outcome" in event.data else {}
    hits = np.array(
        [
            [each["drt.stimulus"], each["drt.response"], each["drt.outcome"]]
            for each in stimuli.values()
            if each.get("outcome") == "hit"
        ]
    )
    assert len(hits) > 10
    sent = session.streams["labcrane.estimate.answer"]
    valued = sent.data[sent.data["state"] == 0.0]
    assert len(valued) > 20
    for time, value in zip(sent.time[valued.index], valued.itertuples(), strict=True):
        seen = hits[(hits[:, 0] > value.first - 0.002) & (hits[:, 2] < time + 0.002)]
        assert value.response_time == pytest.approx((seen[:, 1] - seen[:, 0]).mean(), abs=0.001)
