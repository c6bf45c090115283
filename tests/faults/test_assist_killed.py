"""A session with an assistant that is killed in a trial, and resumed."""

from pathlib import Path

import numpy as np
import pytest
from faults.sessions import killed_and_resumed
from simple_crane import CRANE

STUDY = (
    """\
labcrane: 1
study: killed_assist
title: A study that is killed while an assistant helps
rate_hz: 240
"""
    + CRANE
    + """\
assist: {use: toward_target, share: {most: 0.8}}
tasks:
  aiming: {use: aiming, distances: [1], movements: 4, limit_s: 8}
sessions:
  - {name: only, steps: [{block: {task: aiming, pairs: 1, feedback: [most]}}]}
on_fault: {session_died: redo_trial}
"""
)


@pytest.mark.slow
def test_a_killed_session_is_resumed_with_its_share_and_every_tick_is_the_blend(
    tmp_path: Path,
) -> None:
    session = killed_and_resumed(tmp_path, STUDY, 5.0 * 240 * 8 * 75)
    assert set(session.events["part"]) == {1, 2}
    assert (session.trials["outcome"] == "success").sum() == 4
    loop, command = (session.streams[name].data for name in ("loop", "command"))
    moving = (loop["trial"] > 0) & (loop["paused"] == 0.0)
    share = command["assist.share"].to_numpy()
    assert set(share[moving]) == {0.8}
    parts = {
        who: command.filter(regex=rf"^{who}\.(slew|shoulder|elbow|wrist)$").to_numpy()
        for who in ("command", "assist.operator", "assist.assistant")
    }
    own = (1.0 - share[:, None]) * parts["assist.operator"]
    assert np.array_equal(parts["command"], own + share[:, None] * parts["assist.assistant"])
