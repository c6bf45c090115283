"""Commands that run a session: demo, run and resume."""

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from labcrane.cli.options import DataBeside, Local, ProtocolHere, data_folder, stay_on_this_computer
from labcrane.cli.output import out
from labcrane.errors import LabcraneError, PluginError, ProtocolError

if TYPE_CHECKING:
    from labcrane.session.visit import Visit

Participant = Annotated[str, typer.Option(help="pseudonym: P001")]
SessionNumber = Annotated[int, typer.Option(help="which of the protocol's sessions")]
Simulate = Annotated[
    bool, typer.Option("--simulate", help="a simulated operator takes the controls")
]
Pilot = Annotated[bool, typer.Option("--pilot", help="a pilot session; its files are named PILOT")]
Page = Annotated[
    bool | None,
    typer.Option("--page/--no-page", help="the pages in the browser; on unless --simulate"),
]
WithFeedback = Annotated[
    bool | None,
    typer.Option(
        "--feedback/--no-feedback",
        help="start views and sounds; by default when a person operates the machine",
    ),
]

RealTime = Annotated[
    bool,
    typer.Option("--real-time", help="give the loop priority and its own core"),
]


def run(
    protocol: ProtocolHere,
    participant: Participant,
    session: SessionNumber = 1,
    data: DataBeside = None,
    simulate: Simulate = False,
    fast: Annotated[
        bool, typer.Option("--fast", help="with --simulate: as fast as possible, no LSL")
    ] = False,
    pilot: Pilot = False,
    local: Local = False,
    page: Page = None,
    feedback: WithFeedback = None,
    real_time: RealTime = False,
) -> None:
    """Run a session of a study."""
    if fast and not simulate:
        raise ProtocolError("--fast needs --simulate; add it, or drop --fast")
    if fast and real_time:
        raise ProtocolError("--fast and --real-time cannot be combined; drop one")
    from labcrane.session.visit import visit_of

    visit = visit_of(
        protocol,
        participant,
        session,
        data_folder(data, protocol),
        simulated=simulate,
        pilot=pilot,
        feedback=not simulate if feedback is None else feedback,
        real_time=real_time,
    )
    if local or simulate:
        stay_on_this_computer()
    if fast:
        out.print(f"participant file: {_run_fast(visit)}", markup=False)
    else:
        _launch(visit, page=not simulate if page is None else page)


def resume(
    protocol: ProtocolHere,
    participant: Participant,
    session: SessionNumber = 1,
    data: DataBeside = None,
    policy: Annotated[
        Literal["continue", "redo_trial", "redo_block"] | None,
        typer.Option(help="where to continue; the protocol's policy by default"),
    ] = None,
    simulate: Simulate = False,
    pilot: Pilot = False,
    local: Local = False,
    page: Page = None,
    feedback: WithFeedback = None,
    real_time: RealTime = False,
) -> None:
    """Continue an interrupted session and complete what remains."""
    from labcrane.session.visit import visit_of

    folder = data_folder(data, protocol)
    if local or simulate:
        stay_on_this_computer()
    shown = not simulate if feedback is None else feedback
    visit = visit_of(
        protocol,
        participant,
        session,
        folder,
        simulated=simulate,
        pilot=pilot,
        resumed=True,
        policy=policy,
        feedback=shown,
        real_time=real_time,
    )
    if visit.study.outdated:
        out.print("continued as it was begun; a new session would be refused:", markup=False)
        out.print(visit.study.outdated, markup=False)
    _launch(visit, page=not simulate if page is None else page)


ENGINES = ("mujoco_crane", "kinematic_crane")
"""Engines for the demo's crane, the best one first. The last needs only labcrane."""


def demo(
    data: Annotated[Path, typer.Option(help="folder for the recording")] = Path("labcrane-demo"),
) -> None:
    """Run a shortened aiming study with a simulated operator, on the best installed engine."""
    stay_on_this_computer()
    from tempfile import TemporaryDirectory

    from labcrane.analysis.report.session_figure import draw
    from labcrane.recording.participant_file.reader import open_recording
    from labcrane.session.visit import visit_of

    engine, lacking = _best_engine()
    with TemporaryDirectory() as folder:
        study = _demo_on(engine, Path(folder))
        visit = visit_of(study, "P001", 1, data, simulated=True)
    number = 1
    while visit.folder.path.exists():  # a demo can be run again; nothing is overwritten
        number += 1
        visit = replace(visit, participant=f"P{number:03}")
    path = _run_fast(visit)
    picture = path.with_suffix(".png")
    draw(open_recording(path).session(1), picture)
    for name, what in lacking.items():
        out.print(f"without {name}: it {what}", markup=False)
    out.print(f"moved by:         {engine}", markup=False)
    out.print(f"participant file: {path}", markup=False)
    out.print(f"the movements:    {picture}", markup=False)


def _best_engine() -> tuple[str, dict[str, str]]:
    """Return the best installed engine, and why each better one is unavailable."""
    from labcrane.core.roles import Dynamics
    from labcrane.registry.registry import discover

    registry = discover()
    lacking: dict[str, str] = {}
    for name in ENGINES:
        if not (what := registry.find(Dynamics, name).missing):
            return name, lacking
        lacking[name] = what
    raise PluginError("no engine for the demo is installed: " + "; ".join(lacking.values()))


def _demo_on(engine: str, folder: Path) -> Path:
    """Write the demo's protocol with this engine: recordings name their engine."""
    from importlib.resources import files

    text = (files("labcrane.cli") / "demo.yaml").read_text(encoding="utf-8")
    study = folder / "demo.yaml"
    study.write_text(text.replace(ENGINES[0], engine), encoding="utf-8")
    return study


def _check(visit: "Visit") -> None:
    """Make sure that a session can be run, before anything of it is shown."""
    from labcrane.session.session import check_free
    from labcrane.session.visit import check_begun, check_new

    check_free(visit)
    (check_begun if visit.resumed else check_new)(visit)
    visit.study.check_installed(simulated=visit.simulated, feedback=visit.feedback)


def _run_fast(visit: "Visit") -> Path:
    from labcrane.cli.terminal import Terminal
    from labcrane.design.counts import TrialCounts
    from labcrane.design.plan import plan_session
    from labcrane.session.commands import QueueConsole
    from labcrane.session.session import run as run_session

    visit = replace(visit, fast=True)
    _check(visit)
    plan = plan_session(visit.study, visit.participant, visit.session)
    console = QueueConsole()
    with Terminal(console, out.console, TrialCounts.of(plan), keys=False):
        return run_session(visit, console)


def _launch(visit: "Visit", *, page: bool) -> None:
    from labcrane.cli.consent import ask_for_consent, await_consent
    from labcrane.cli.sync import print_report
    from labcrane.cli.terminal import Terminal
    from labcrane.design.counts import TrialCounts
    from labcrane.design.plan import plan_session
    from labcrane.launcher.launcher import Launcher
    from labcrane.launcher.pages import pages
    from labcrane.processes.real_time import reserved_core
    from labcrane.registry.offers import LAB, not_installed
    from labcrane.session.commands import QueueConsole
    from labcrane.web.translations import WORDS

    _check(visit)
    needs = {"pylsl": LAB, **({"nicegui": LAB} if page else {})}
    if missing := not_installed(needs):
        raise PluginError(f"a session {missing}")
    ask_for_consent(visit, page=page)
    plan = plan_session(visit.study, visit.participant, visit.session)
    console = QueueConsole()
    with (
        # Before any other process is started: they must not use that core.
        reserved_core() if visit.real_time else nullcontext() as core,
        Terminal(
            console,
            out.console,
            TrialCounts.of(plan),
            keys=not visit.simulated,
            questionnaires=visit.study.questionnaires,
            words=WORDS[visit.study.protocol.page.language],
            alone=not page,
        ) as terminal,
    ):
        visit = replace(visit, core=core)
        launcher = Launcher(visit, console, terminal.say)
        with (
            pages(visit, launcher, console, terminal.say, feedback=visit.feedback)
            if page
            else nullcontext()
        ):
            if page:
                await_consent(visit, console, terminal.say)
            outcome = launcher.run()
    if outcome.sync_report is not None:
        print_report(outcome.sync_report)
    if visit.folder.participant_file.exists():
        out.print(f"participant file: {visit.folder.participant_file}", markup=False)
    again = f"to continue, run: {visit.resume_command}"
    if outcome.owed:
        out.print(f"the session is incomplete: {outcome.owed}; {again}", markup=False)
    if outcome.died is not None:
        raise LabcraneError(
            f"the session process died with exit code {outcome.died}"
            f"{f' in {outcome.where}' if outcome.where else ''}; its recording is in the "
            f"participant file; {again}"
        )
