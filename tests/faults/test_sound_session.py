"""A session's sound in real time."""

import math
from pathlib import Path

import numpy as np
import pytest
from faults.jack_session import Examiner, a_jack_session
from faults.sessions import unique
from needs import needs
from simple_crane import FORM

from labcrane.core import Event
from labcrane.testing import Command, Order

STUDY = (
    """\
labcrane: 1
study: {study}
title: A study with sound
rate_hz: 240
"""
    + FORM
    + """\
tasks:
  aiming: {{use: aiming, distances: [2], movements: 200, limit_s: 1.2}}
feedback:
  tone: {{use: sonification, driver: jack, block: 1024}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming}}
"""
)

SECONDS = 10.0

LIMIT_S = 1.2
"""Of a trial, which nobody ends sooner."""


class Ending(Examiner):
    """Ends the session after seconds of trials: the first begins when there is sound."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self._seconds = seconds
        self.first = math.inf

    def report(self, event: Event) -> None:
        super().report(event)
        if event.name != "trial.start":
            return
        self.first = min(self.first, event.time)
        if event.time > self.first + self._seconds:
            self.give(Command(Order.END))


@pytest.mark.long
@needs("jackd", "real-time priorities")
def test_a_session_is_heard_in_real_time_from_its_first_trial_to_its_end(tmp_path: Path) -> None:
    # That no block is missed on a busy computer is measured by benchmarks.beside.
    session, _ = a_jack_session(
        STUDY.format(study=unique("sound")),
        tmp_path,
        Ending(SECONDS),
        real_time=True,
    )
    heard = session.streams["labcrane.feedback.tone"]
    assert "feedback.lost" not in set(session.events["name"])
    trials = session.trials
    assert heard.time[0] < trials["started"].iloc[0]
    # The last trial is ended in the tick in which it began, before a block of it is heard.
    assert trials["outcome"].iloc[-1] == "ended"
    assert len(trials) > SECONDS / LIMIT_S
    for trial in trials.iloc[:-1].itertuples():
        assert np.any((heard.time > trial.started) & (heard.time < trial.ended)), trial.index
    assert np.count_nonzero(np.diff(heard.data["tone.pitch"].to_numpy())) > SECONDS
    (ready,) = (e for e in session.events.itertuples() if e.name == "feedback.ready")
    assert "scheduling real time" in ready.data["facts"]
