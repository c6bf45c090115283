"""Plugins that raise, return nonsense, dawdle, hang or exit, in each of their methods."""

import multiprocessing
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from faults.sessions import unique
from rehearsal import ScriptedConsole

from labcrane import LabcraneError, PluginError, feedback_keeper, open_recording
from labcrane import session as session_module
from labcrane import stillness as stillness_module
from labcrane.cli.app import main
from labcrane.console import Command, Order, QueueConsole
from labcrane.frame_log import FrameLog
from labcrane.launcher import Launcher, Outcome
from labcrane.recording.recording import SessionRecord
from labcrane.registry import discover
from labcrane.session import Visit, run
from labcrane.session_process import VisitOrder
from labcrane.study import load

STUDY = """\
labcrane: 1
study: {study}
title: A study with a faulty plugin
rate_hz: 240
machine: ch8
input: {{use: dual_joystick}}
operator: {{use: faulty_input}}
scheme:
  use: faulty_scheme
  map: {{slew: left.x, elbow: left.y, wrist: right.x, shoulder: -right.y}}
dynamics: {{use: faulty_dynamics}}
tasks:
  aiming: {{use: faulty_task, distances: [2], movements: 1, limit_s: 0.5}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming, pairs: 1}}
      - questionnaire: faulty_questionnaire
      - block: {{task: aiming, pairs: 1}}
"""

Spoil = Callable[[str], Path]


@pytest.fixture
def spoil(tmp_path: Path) -> Spoil:
    """Return what writes a study whose plugin does as ordered."""

    def write(order: str) -> Path:
        (tmp_path / "plugins").mkdir()
        shutil.copy(Path(__file__).with_name("faulty.py"), tmp_path / "plugins")
        (tmp_path / "plugins" / "order.txt").write_text(order)
        path = tmp_path / "study.yaml"
        path.write_text(STUDY.format(study=unique("faulty")))
        return path

    return write


def run_fast(protocol: Path) -> None:
    study = load(protocol, discover(study=protocol))
    visit = Visit(study, "P001", 1, protocol.parent / "data", simulated=True, fast=True)
    wanted = (protocol.parent / "plugins" / "order.txt").read_text().split()[1]
    override = {20: [Command(Order.OVERRIDE)]} if wanted == "overrule" else {}
    run(visit, ScriptedConsole(override))


def run_through(protocol: Path) -> None:
    """Run fast, but write frames through and say where it is, as a session with people does."""
    session_module.BatchLog = FrameLog
    session_module._watching = lambda visit, the_rig: visit.study.oversight.published(
        visit.whereabouts
    )
    run_fast(protocol)


def recorded(protocol: Path) -> SessionRecord | None:
    """Return the session, if there is one, and see that no tick is missing."""
    files = list(protocol.parent.glob("data/*/*.h5"))
    if not files:
        return None
    session = open_recording(files[0]).session(1)
    ticks = session.streams["loop"].data["tick"].to_numpy()
    np.testing.assert_array_equal(ticks, np.arange(len(ticks)))
    return session


METHODS = {
    "input": {"open": 1, "begin_trial": 2, "read": 50, "close": 1, "facts": 1},
    "scheme": {"open": 1, "begin_trial": 2, "command": 50, "rest": 1, "close": 1, "facts": 1}
    | {"steer": 20},
    "dynamics": {"open": 1, "begin_trial": 2, "state": 50, "step": 50, "bodies": 1, "close": 1}
    | {"facts": 1},
    "task": {"factors": 1, "plan": 1, "open": 1, "begin_trial": 2, "judge": 50, "close": 1}
    | {"overrule": 1},
    "questionnaire": {"items": 1, "score": 1},
}
"""Every method that a simulated session calls, and at which call it fails."""

CASES = [(role, method, at) for role, calls in METHODS.items() for method, at in calls.items()]
RUNNING = {"begin_trial", "read", "command", "steer", "state", "step", "judge", "overrule", "items"}
RUNNING |= {"score"}


def line_of(text: str) -> int:
    lines = Path(__file__).with_name("faulty.py").read_text().splitlines()
    return 1 + next(at for at, line in enumerate(lines) if text in line)


@pytest.mark.parametrize(
    ("role", "method", "at", "how"),
    [*((*case, "raising") for case in CASES), ("dynamics", "step", 50, "leaving")],
)
def test_a_method_that_raises_is_named_with_its_line_and_nothing_is_lost(
    role: str, method: str, at: int, how: str, spoil: Spoil
) -> None:
    protocol = spoil(f"{role} {method} {at} {how}")
    with pytest.raises(PluginError) as caught:
        run_fast(protocol)
    said = str(caught.value)
    assert said.startswith(f"{role} 'faulty_{role}' of plugin 'plugins/faulty.py', in {method}() (")
    raised = {"raising": "ValueError: a mistake in a plugin", "leaving": "SystemExit: had enough"}
    line = line_of("raise ValueError" if how == "raising" else "raise SystemExit")
    assert f"raised {raised[how]} ({protocol.parent / 'plugins' / 'faulty.py'}:{line})" in said
    session = recorded(protocol)
    if method in RUNNING:
        assert session is not None
        failed = session.events.query("name == 'session.failed'")
        assert [data["why"] for data in failed["data"]] == [said]
        tick = int(re.search(r"in tick (\d+)$", said)[1])
        assert len(session.streams["loop"].data) == tick
        assert "labcrane resume" in caught.value.__notes__[0]
        run_again(protocol)
    elif method == "close":
        assert session is not None
        assert session.events["name"].iloc[-1] == "session.end"


def run_again(protocol: Path) -> None:
    """Mend the plugin and go on, as the protocol's policy says: the trial is done again."""
    (protocol.parent / "plugins" / "order.txt").write_text("nobody nothing 1 raising")
    study = load(protocol, discover(study=protocol))
    visit = Visit(
        study, "P001", 1, protocol.parent / "data", simulated=True, fast=True, resumed=True
    )
    run(visit, ScriptedConsole())
    session = open_recording(visit.folder.participant_file).session(1)
    last = session.trials.groupby("trial").tail(1)
    assert last["outcome"].isin(["success", "timeout"]).all()
    assert len(last) == 2


def test_a_machine_that_cannot_be_reset_is_named_when_its_session_is_gone_on_with(
    spoil: Spoil,
) -> None:
    protocol = spoil("task judge 50 raising")
    with pytest.raises(PluginError, match=r"in judge\(\)"):
        run_fast(protocol)
    # The crane resets itself once when it is opened.
    (protocol.parent / "plugins" / "order.txt").write_text("dynamics reset 2 raising")
    study = load(protocol, discover(study=protocol))
    visit = Visit(
        study, "P001", 1, protocol.parent / "data", simulated=True, fast=True, resumed=True
    )
    with pytest.raises(PluginError, match=r"^dynamics .* in reset\(\) .* raised ValueError"):
        run(visit, ScriptedConsole())
    run_again(protocol)


NONSENSE = {
    ("input", "read", "nan"): "returned left.y nan in tick 49",
    ("input", "read", "short"): "returned shape (11,), and its signals promise (12,) in tick 49",
    ("input", "read", "nothing"): "returned NoneType, and not an array of float64 in tick 49",
    ("scheme", "command", "nan"): "returned command.shoulder nan in tick",
    ("scheme", "command", "short"): "returned shape (",
    ("dynamics", "state", "nan"): "returned joint.angle.shoulder nan in tick",
    ("dynamics", "step", "nan"): "returned joint.angle.shoulder nan in tick 49",
    ("dynamics", "step", "short"): "returned shape (13,), and its signals promise (14,) in tick 49",
    ("task", "judge", "judged_short"): "returned shape (6,), and its signals promise (7,) in tick",
    ("task", "judge", "nothing"): "returned None in tick",
}


@pytest.mark.parametrize(("role", "method", "how"), NONSENSE)
def test_nonsense_is_refused_before_it_is_recorded(
    role: str, method: str, how: str, spoil: Spoil
) -> None:
    protocol = spoil(f"{role} {method} 50 {how}")
    with pytest.raises(PluginError) as caught:
        run_fast(protocol)
    said = str(caught.value)
    source = protocol.parent / "plugins" / "faulty.py"
    where = f"in {method}() ({source}:{line_of('def bad')})"
    assert said.startswith(f"{role} 'faulty_{role}' of plugin 'plugins/faulty.py', {where}, ")
    assert NONSENSE[role, method, how] in said
    session = recorded(protocol)
    assert session is not None
    for name in ("input", "command", "state"):
        assert np.isfinite(session.streams[name].data.to_numpy()).all()


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
    process.join(60)
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


def launch(protocol: Path) -> tuple[Outcome, list[str]]:
    order = VisitOrder(
        protocol, "P001", 1, protocol.parent / "data", simulated=True, feedback=False
    )
    told: list[str] = []
    return Launcher(order, QueueConsole(), told.append).run(), told


def test_the_launcher_says_in_which_component_a_session_died(spoil: Spoil) -> None:
    protocol = spoil("dynamics step 100 exiting")
    outcome, _ = launch(protocol)
    assert outcome.died == 7
    assert outcome.where.startswith("dynamics 'faulty_dynamics' of plugin 'plugins/faulty.py'")
    assert outcome.where.endswith("tick 99")
    session = recorded(protocol)
    assert session is not None
    assert len(session.streams["loop"].data) == 99


def test_the_launcher_passes_on_what_a_session_says_of_a_plugin(spoil: Spoil) -> None:
    protocol = spoil("scheme command 20 raising")
    with pytest.raises(
        LabcraneError, match=r"scheme 'faulty_scheme' .* raised ValueError"
    ) as caught:
        launch(protocol)
    assert "labcrane resume" in caught.value.__notes__[0]
    assert recorded(protocol) is not None


def test_a_component_that_hangs_is_named_and_its_process_ended(
    spoil: Spoil, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stillness_module, "TELL_S", 0.5)
    monkeypatch.setattr(stillness_module, "HANG_S", 1.5)
    protocol = spoil("task judge 30 hanging")
    outcome, told = launch(protocol)
    assert outcome.died == -9
    place = "task 'faulty_task' of plugin 'plugins/faulty.py', in judge() ("
    assert outcome.where.startswith(place)
    (said,) = (line for line in told if "stood still" in line)
    assert place in said
    tick = int(re.search(r"tick (\d+)", said)[1])
    session = recorded(protocol)
    assert session is not None
    assert len(session.streams["loop"].data) == tick


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
    order = VisitOrder(protocol, "P001", 1, protocol.parent / "data", simulated=True)
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
    monkeypatch.setattr(feedback_keeper, "SILENT_S", 30.0)  # a busy computer makes all of them slow
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


def test_an_exporter_that_raises_is_named_with_its_line(
    spoil: Spoil,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    from labcrane_xdf.merged import MergedXdf

    def export(self, participants, folder):
        raise KeyError("no such stream")

    run_fast(spoil("nobody nothing 1 raising"))
    monkeypatch.setattr(MergedXdf, "export", export)
    arguments = ["--to", "xdf", "--include", "simulated", "--out", str(tmp_path / "out")]
    assert main(["export", str(tmp_path / "data"), *arguments]) == 1
    said = capsys.readouterr().err
    assert "exporter 'xdf' of plugin 'xdf'" in said
    assert re.search(r"raised KeyError: 'no such stream' \(.*test_plugins\.py:\d+\)", said)
