"""Plugins that exit, hang, raise or dawdle in a process of a running session."""

import multiprocessing
import re
from dataclasses import replace
from pathlib import Path

import pytest
from faults.faulty_study import (
    CASES,
    RUNNING,
    Spoil,
    line_of,
    recorded,
    run_again,
    run_through,
)

from labcrane import LabcraneError, open_recording
from labcrane.feedback import handle as feedback_handle
from labcrane.launcher import hang_detector
from labcrane.launcher.launcher import Launcher, Outcome
from labcrane.recording import SessionRecord
from labcrane.session.visit import visit_of
from labcrane.testing import QueueConsole, main


@pytest.mark.long
@pytest.mark.parametrize(
    ("role", "method", "at"),
    [case for case in CASES if case[1] not in {"factors", "plan", "bodies"}],
)
def test_a_process_that_exits_has_left_word_where_it_was(
    role: str, method: str, at: int, spoil: Spoil, capsys: pytest.CaptureFixture[str]
) -> None:
    protocol = spoil(f"{role} {method} {at} exiting")
    process = multiprocessing.get_context("fork").Process(target=run_through, args=(protocol,))
    process.start()
    process.join(240)
    assert process.exitcode == 7
    data = protocol.parent / "data"
    written = list(data.glob("*/ses-01_run.where"))
    assert len(written) == 1
    place = f"{role} 'faulty_{role}' of plugin 'plugins/faulty.py', in {method}() ("
    if method in RUNNING | {"close"}:
        assert main(["recover", str(data)]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert f"its process was last in {place}" in said
        session = recorded(protocol)
        assert session is not None
        tick = int(re.search(r"tick (\d+)", said)[1])
        assert len(session.streams["loop"].data) == tick + (method == "close")
    if method in RUNNING:
        run_again(protocol)
        session = recorded_in_parts(protocol)
        died = session.events.query("name == 'session.died'")["data"].iloc[0]
        assert died["where"].startswith(place)
        assert died["died_in_tick"] == tick
        assert not list(data.glob("*/*.where"))


def recorded_in_parts(protocol: Path) -> SessionRecord:
    (path,) = protocol.parent.glob("data/*/*.h5")
    return open_recording(path).session(1)


def launch(protocol: Path, *, resumed: bool = False) -> tuple[Outcome, list[str]]:
    order = visit_of(protocol, "P001", 1, protocol.parent / "data", simulated=True, feedback=False)
    order = replace(order, resumed=resumed)
    told: list[str] = []
    return Launcher(order, QueueConsole(), told.append).run(), told


@pytest.mark.slow
def test_the_launcher_says_in_which_component_a_session_died(spoil: Spoil) -> None:
    protocol = spoil("dynamics step 100 exiting")
    outcome, _ = launch(protocol)
    assert outcome.died == 7
    assert outcome.where.startswith("dynamics 'faulty_dynamics' of plugin 'plugins/faulty.py'")
    assert outcome.where.endswith("tick 99")
    session = recorded(protocol)
    assert session is not None
    assert len(session.streams["loop"].data) == 99


@pytest.mark.slow
def test_the_launcher_passes_on_what_a_session_says_of_a_plugin(spoil: Spoil) -> None:
    protocol = spoil("scheme command 20 raising")
    with pytest.raises(
        LabcraneError, match=r"scheme 'faulty_scheme' .* raised ValueError"
    ) as caught:
        launch(protocol)
    assert "labcrane resume" in caught.value.__notes__[0]
    assert recorded(protocol) is not None


@pytest.mark.slow
def test_a_component_that_hangs_is_named_and_its_process_ended(spoil: Spoil) -> None:
    protocol = spoil("task evaluate 30 hanging")
    outcome, told = launch(protocol)
    assert outcome.died == -9
    place = "task 'faulty_task' of plugin 'plugins/faulty.py', in evaluate() ("
    assert outcome.where.startswith(place)
    # A computer that is held up may have made it stand still before.
    said = [line for line in told if "not advanced" in line][-1]
    assert place in said
    tick = int(re.search(r"tick (\d+)", said)[1])
    session = recorded(protocol)
    assert session is not None
    assert len(session.streams["loop"].data) == tick


@pytest.mark.slow
def test_a_session_that_begins_slowly_is_not_ended_for_where_it_died_before(
    spoil: Spoil, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its marker stands still until the new process has loaded the study and read its journals."""
    protocol = spoil("task evaluate 30 exiting")
    assert launch(protocol)[0].died == 7
    (protocol.parent / "plugins" / "order.txt").write_text("nobody nothing 1 raising")
    patience_s = 3.0
    monkeypatch.setattr(hang_detector, "HANG_S", patience_s)
    slow = f"import sys, time\nif 'session_process' in sys.argv[0]: time.sleep({patience_s + 1})\n"
    (protocol.parent / "plugins" / "slow.py").write_text(slow)
    outcome, told = launch(protocol, resumed=True)
    assert outcome.died is None, told
    events = recorded_in_parts(protocol).events
    died = events.query("name == 'session.died'")["data"].iloc[0]
    assert died["where"].startswith("task 'faulty_task' of plugin 'plugins/faulty.py', in evaluate")
    assert events["data"].iloc[-1]["reason"] == "complete"


PRESENTING = """\
feedback: {{dot: {{use: {cue}}}}}
views:
{views}
on_fault: {{feedback_lost: continue}}
"""


def present(protocol: Path, cue: str, views: list[str]) -> tuple[SessionRecord, dict[str, str]]:
    """Run a session with views; return it, and why each view was lost."""
    lines = "\n".join(f"  {view}: {{use: faulty_feedback, how: {view}}}" for view in views)
    study = protocol.read_text().replace("limit_s: 0.5", "limit_s: 3")
    protocol.write_text(study + PRESENTING.format(cue=cue, views=lines))
    order = visit_of(protocol, "P001", 1, protocol.parent / "data", simulated=True, feedback=True)
    assert Launcher(order, QueueConsole(), lambda text: None).run().died is None
    session = recorded(protocol)
    assert session is not None
    assert session.events["name"].iloc[-1] == "session.end"
    assert session.trials["outcome"].isin(["success", "timeout"]).all()
    lost = session.events.query("name == 'feedback.lost'")["data"]
    return session, {data["what"]: data["why"] for data in lost}


@pytest.mark.long
def test_feedback_that_fails_is_named_with_its_line_and_the_session_goes_on(
    spoil: Spoil, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(feedback_handle, "SILENT_S", 30.0)  # a busy computer makes all of them slow
    protocol = spoil("nobody nothing 1 raising")
    views = ["raising", "short", "exiting", "nan", "slow"]
    session, why = present(protocol, "faulty_cue", views)
    source = protocol.parent / "plugins" / "faulty.py"
    assert set(why) == {"raising", "short", "exiting"}, why
    mistake = f"ValueError: a mistake in a plugin ({source}:{line_of('raise ValueError')})"
    assert mistake in why["raising"]
    assert "feedback 'short' returned shape (1,) from present() (" in why["short"]
    assert f"{source}:{line_of('def present')}" in why["short"]
    assert "its process ended with exit code 7" in why["exiting"]
    slow = session.streams["labcrane.feedback.slow"].data
    assert slow["frame.skipped"].max() > 100, "the newest frame each time, and the others left out"
    nan = session.streams["labcrane.feedback.nan"].data
    assert nan["two"].isna().any()
    assert nan["one"].notna().all()


@pytest.mark.long
def test_a_cue_that_raises_takes_its_view_with_it_and_nothing_else(spoil: Spoil) -> None:
    protocol = spoil("cue draw 5 raising")
    _, why = present(protocol, "faulty_cue", ["fine"])
    source = protocol.parent / "plugins" / "faulty.py"
    assert f"({source}:{line_of('raise ValueError')})" in why["fine"]


@pytest.mark.long
def test_a_slow_component_is_named_and_the_session_goes_on(spoil: Spoil) -> None:
    protocol = spoil("dynamics step 1 slow")
    protocol.write_text(protocol.read_text().replace("rate_hz: 240", "rate_hz: 60"))
    outcome, _ = launch(protocol)
    assert outcome.died is None
    session = recorded(protocol)
    assert session is not None
    assert session.events["name"].iloc[-1] == "session.end"
    (slow,) = session.events.query("name == 'plugin.slow'")["data"]
    assert slow["why"].startswith(
        "dynamics 'faulty_dynamics' of plugin 'plugins/faulty.py', in step"
    )
    assert slow["worst_s"] >= 0.05
    loop = session.streams["loop"].data
    late = (loop["woke"] - loop["due"]).to_numpy()
    assert late[-1] > 0.03 * len(late)  # nothing is skipped: lateness piles up, and is recorded
