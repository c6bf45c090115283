"""Two sessions of real processes: the second gets the values that the first one used."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from faults.sessions import finished, labcrane, session_process, unique, wait_for
from faults.test_estimates_killed import PLUGIN, STUDY
from streams.emulation import Lab, Skew, build

from labcrane import open_recording
from labcrane.design.plan import plan_session
from labcrane.protocol.study import load
from labcrane.recording import SessionRecord
from labcrane.registry.registry import discover

GROUPS = ("alder", "birch")
ROW = 8.0 * 240 * 75
"""About the bytes of a second of a session's journal."""


class Sessions:
    """What the two sessions left, and what their terminals said."""

    def __init__(self, folder: Path, lab: Lab) -> None:
        self.protocol, self.data = folder / "study.yaml", folder / "data"
        study = load(self.protocol, discover(study=self.protocol))
        group = {name: plan_session(study, name, 1).group for name in ("P001", "P002")}
        self.own, self.yoked = sorted(group, key=lambda name: group[name])
        self._lab = lab
        self.refused = self.start(self.yoked, "run").communicate(timeout=240)[0]
        self.said = {self.own: finished(self.start(self.own, "run"))}
        first = self.start(self.yoked, "run")
        journal = self.data / f"{self.yoked}-SIMULATED" / "ses-01_run.xdf"
        wait_for(lambda: journal.exists() and journal.stat().st_size > 4.0 * ROW)
        victim = session_process(first)
        assert victim is not None
        victim.kill()
        before = first.communicate(timeout=240)[0]
        self.said[self.yoked] = before + finished(self.start(self.yoked, "resume"))

    def start(self, name: str, command: str):
        who = ("--participant", name, "--simulate", "--data", self.data)
        process = labcrane(command, self.protocol, *who)
        self._lab.processes.append(process)
        return process

    def record(self, name: str) -> SessionRecord:
        path = self.data / f"{name}-SIMULATED" / f"{name}-SIMULATED.h5"
        return open_recording(path).session(1)


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sessions]:
    folder = tmp_path_factory.mktemp("estimates")
    name = unique("amplifier")
    lab = Lab(folder, build(folder))
    text = STUDY.replace("DEVICE", name).replace("movements: 4", "movements: 2")
    text = text.replace("sampled: -1}", "sampled: -1}, yoked: [birch]")
    groups = "design: {groups: {alder: [], birch: []}}\nsessions:"
    (folder / "study.yaml").write_text(text.replace("sessions:", groups))
    (folder / "plugins").mkdir()
    (folder / "plugins" / "truth.py").write_text(PLUGIN)
    lab.device(name, Skew(), rate=250.0)
    try:
        yield Sessions(folder, lab)
    finally:
        lab.close()
        shutil.rmtree(folder / "data", ignore_errors=True)


def last_attempts(session: SessionRecord) -> dict[int, slice]:
    """Return the rows of the last attempt at each trial, by its events alone."""
    due = session.streams["loop"].data["due"].to_numpy()
    trials = session.trials
    ends = {row.trial: (row.started, row.ended) for row in trials.itertuples()}
    return {
        number: slice(*np.searchsorted(due, (start - 1e-4, end + 1e-4)))
        for number, (start, end) in ends.items()
    }


@pytest.mark.slow
def test_each_tick_of_a_trial_has_the_values_and_states_of_the_others_tick(
    sessions: Sessions,
) -> None:
    records = [sessions.record(name) for name in (sessions.own, sessions.yoked)]
    parts = [last_attempts(record) for record in records]
    compared = 0
    for number in parts[0].keys() & parts[1].keys():
        one, other = (
            record.streams["input"].data.filter(regex=r"^estimate\.").to_numpy()[part[number]]
            for record, part in zip(records, parts, strict=True)
        )
        size = min(len(one), len(other))
        one, other = one[:size], other[:size]
        np.testing.assert_array_equal(one[:, [0, 2]], other[:, [0, 2]])
        shift = (other[:, 1] - one[:, 1])[one[:, 2] == 0.0]
        assert len(shift) == 0 or np.ptp(shift) < 1e-4
        compared += int((one[:, 2] == 0.0).sum())
    assert compared > 200


@pytest.mark.slow
def test_the_record_says_whose_values_they_are_also_after_a_kill(sessions: Sessions) -> None:
    session = sessions.record(sessions.yoked)
    starts = session.events[session.events["name"] == "session.start"]["data"].tolist()
    assert [each["yoked_to"] for each in starts] == 2 * [f"{sessions.own}-SIMULATED"]
    assert session.attrs["yoked_to"] == f"{sessions.own}-SIMULATED"
    assert "yoked_to" not in sessions.record(sessions.own).context


@pytest.mark.slow
def test_the_own_values_are_in_the_record_too(sessions: Sessions) -> None:
    session = sessions.record(sessions.yoked)
    own = session.streams["labcrane.estimate.truth"].data["sampled"]
    frames = session.streams["input"].data
    used = frames["estimate.truth.sampled"][frames["estimate.truth.state"] == 0.0]
    assert len(own) > 100
    assert own.min() > used.max(), "the true times of another session"


@pytest.mark.slow
def test_no_terminal_tells_the_group(sessions: Sessions) -> None:
    assert "it comes after those of other participants" in sessions.refused
    for text in (sessions.refused, *sessions.said.values()):
        assert not re.search("alder|birch|yoke|sham", text)
