"""A session with a detection response task that is killed in a block, and resumed."""

from pathlib import Path

import numpy as np
import pytest
from faults.sessions import killed_and_resumed
from simple_crane import CRANE

from labcrane.analysis import responses

STUDY = (
    """\
labcrane: 1
study: killed_drt
title: A study that is killed between two stimuli
rate_hz: 240
"""
    + CRANE
    + """\
operator: {use: simulated_operator, response: {to: drt.stimulus, lapse_rate: 0, load: 0}}
tasks:
  aiming: {use: aiming, distances: [2], movements: 6, limit_s: 4}
secondary:
  drt: {use: drt}
sessions:
  - name: only
    steps:
      - block: {task: aiming, pairs: 1}
on_fault: {session_died: redo_trial}
"""
)

SECONDS = 12.0
"""Of recording before the kill, at least: two stimuli have been given."""


@pytest.mark.slow
def test_a_block_that_is_killed_and_resumed_keeps_its_stimuli_and_their_intervals(
    tmp_path: Path,
) -> None:
    a_second = 240 * 8 * 55  # bytes, about
    session = killed_and_resumed(tmp_path, STUDY, SECONDS * a_second)
    found, events = responses(session), session.events
    given = events[events["name"] == "drt.stimulus"]
    assert set(given["part"]) == {1, 2}
    assert len(found) == len(given)
    for _, own in given.groupby("part"):
        gaps = np.diff(own["time"])
        assert gaps.min() >= 3.0 - 1 / 240
        assert gaps.max() <= 5.0 + 1 / 240
    # Nothing of before the kill comes again: the attempts have seeds of their own.
    first, second = (np.diff(own["time"]) for _, own in given.groupby("part"))
    assert not np.isclose(first[0], second).any()
    assert (found["outcome"] == "hit").sum() >= len(found) - 2  # at the kill, and at the end
