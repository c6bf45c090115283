"""A minute of a session's sound on a busy computer, without one block missing."""

import math
from pathlib import Path

import numpy as np
import pytest
from busy_computer import a_busy_computer
from faults.jack_session import Examiner, a_jack_session
from faults.sessions import unique
from needs import needs
from simple_crane import FORM

from labcrane.core.records import Event
from labcrane.session.commands import Command, Order

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

SECONDS, PERIOD_S = 60.0, 1024 / 48000
ATTEMPTS = 3


class Ending(Examiner):
    """Ends the session after a minute of trials: the first begins when there is sound."""

    def __init__(self) -> None:
        super().__init__()
        self.first = math.inf

    def report(self, event: Event) -> None:
        super().report(event)
        if event.name != "trial.start":
            return
        self.first = min(self.first, event.time)
        if event.time > self.first + SECONDS + 5.0:
            self.give(Command(Order.END))


@pytest.mark.long
@pytest.mark.timeout(900)
@needs("jackd", "real-time priorities")
def test_a_minute_of_sound_in_real_time_has_no_underrun(tmp_path: Path) -> None:
    # What runs on a core that stands still, as on a computer that is shared, is late whatever its
    # priority: an underrun then says nothing about the sound, and the attempt is made again.
    for attempt in range(ATTEMPTS):
        folder = tmp_path / str(attempt)
        folder.mkdir()
        with a_busy_computer() as stillness:
            session, complaints = a_jack_session(
                STUDY.format(study=unique("sound")),
                folder,
                Ending(),
                real_time=True,
            )
        if not complaints or stillness.most_s < PERIOD_S / 2:
            break
    assert complaints == [], stillness
    heard = session.streams["labcrane.feedback.tone"]
    assert "feedback.lost" not in set(session.events["name"])
    assert np.ptp(heard.time) > SECONDS
    assert heard.data["tone.missed"].iloc[-1] == 0.0, stillness
    changes = np.count_nonzero(np.diff(heard.data["tone.pitch"].to_numpy()))
    assert changes > 20 * SECONDS
    (ready,) = (e for e in session.events.itertuples() if e.name == "feedback.ready")
    assert "scheduling real time" in ready.data["facts"]
