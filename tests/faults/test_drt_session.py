"""The detection response task in sessions in real time: seen on a screen, heard from a server."""

from pathlib import Path

import numpy as np
import pytest
from faults.jack_session import Examiner, a_jack_session
from faults.sessions import unique
from needs import needs
from simple_crane import FORM
from windows import an_x_server

from labcrane.analysis import responses

DELAY_S = 0.1
"""Of the operator, from the frame with the stimulus to the response."""

RATE_HZ = 240.0

STUDY = (
    """\
labcrane: 1
study: {study}
title: A study with a detection response task
rate_hz: 240
"""
    + FORM
    + """\
operator:
  use: simulated_operator
  response: {{to: drt.stimulus, median_s: 0.1, sd: 0, lapse_rate: 0, load: 0, press_s: 0.02}}
tasks:
  aiming: {{use: aiming, distances: [2], movements: 36, limit_s: 6}}
secondary:
  drt: {{use: drt, interval_s: [0.3, 0.5], longest_s: 0.2, hit_s: [0.02, 0.25]}}
feedback:
  light: {{use: stimulus_light, stimulus: drt.stimulus}}
  beep: {{use: sonification, stimulus: drt.stimulus, driver: jack}}
views:
  screen: {{use: view, size: [320, 240], rate_hz: 60}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming, pairs: 1, feedback: [drt, {presented}]}}
"""
)


@pytest.mark.long
@needs("jackd", "Xvfb")
@pytest.mark.parametrize("presented", ["light", "beep"])
def test_response_times_count_from_when_a_stimulus_was_seen_or_heard(
    presented: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = STUDY.format(study=unique("drt"), presented=presented)
    with an_x_server() as display:
        monkeypatch.setenv("DISPLAY", display)
        session, _ = a_jack_session(text, tmp_path, Examiner())
    found = responses(session)
    found = found[found["outcome"] != "held"]
    assert len(found) >= 250
    # The operator sees the frame, not the screen: shown is later than sent by the presentation.
    sent = found["responded"] - found["sent"]
    assert np.abs(sent - DELAY_S).max() <= 1.0 / RATE_HZ + 1e-6
    late = found["shown"] - found["sent"]
    assert late.min() > 0.0
    shown = found[found["outcome"] == "hit"]
    np.testing.assert_allclose(shown["response_time"] + late[shown.index], DELAY_S, atol=0.0042)
