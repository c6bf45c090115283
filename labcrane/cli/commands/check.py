"""Commands before anything is run: start, new-study, check, plan and pages."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.cli.options import AsJson, DataBeside, ProtocolHere, data_folder, study_of
from labcrane.cli.output import out
from labcrane.errors import LabcraneError

if TYPE_CHECKING:
    from labcrane.design.plan import PlannedBlock, PlannedStep, SessionPlan
    from labcrane.design.tracks import PlannedTrack
    from labcrane.protocol.questions import CheckQuestion
    from labcrane.protocol.study import Study


def start(
    folder: Annotated[
        Path | None,
        typer.Argument(metavar="FOLDER", help="folder of your studies; by default this one"),
    ] = None,
    port: Annotated[int, typer.Option(help="port of the page; 0 selects a free one")] = 0,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="open the page in the browser")
    ] = True,
) -> None:
    """Make, check, rehearse and run a study in a browser, without writing YAML."""
    import webbrowser

    from labcrane.cli.offered import offered
    from labcrane.cli.shipped import shipped_studies
    from labcrane.errors import PluginError, StorageError
    from labcrane.registry.offers import LAB, not_installed

    if missing := not_installed({"nicegui": LAB}):
        raise PluginError(f"the start page {missing}")
    from labcrane.start.service import serve
    from labcrane.web.handle import free_port
    from labcrane.web.server.serving import HOST

    root = (folder or Path()).resolve()
    if not root.is_dir():
        raise StorageError(f"{root} is not a folder; give the folder of your studies")

    def say(line: str) -> None:
        out.print(line, markup=False)
        if browser and line.startswith("start: "):
            webbrowser.open(line.removeprefix("start: "))

    out.print("Ctrl-C ends it", markup=False)
    serve(root, sorted(shipped_studies()), list(offered()), free_port(HOST, port), say)


def new_study(
    shipped: Annotated[
        str,
        typer.Argument(
            help="aiming, crane_pilot, crossover, pre_post, retrieval, washout or whole"
        ),
    ],
    folder: Annotated[Path, typer.Argument(help="a new folder; the study is named after it")],
) -> None:
    """Copy a study that comes with labcrane, with everything it refers to, as a starting point."""
    from labcrane.cli.shipped import new_study as copied

    protocol = copied(shipped, folder)
    typer.echo(f"study: {protocol}\nnext: labcrane check {folder}, and change {protocol}")


def check(
    protocol: ProtocolHere,
    as_json: AsJson = False,
    simulated: Annotated[
        bool,
        typer.Option("--simulated", help="require only what a simulation needs to be installed"),
    ] = False,
    rehearse: Annotated[
        bool,
        typer.Option("--rehearse", help="also run one trial of each block for every group"),
    ] = False,
) -> None:
    """Check a protocol and everything it refers to, without running it."""
    from labcrane.protocol.questions import about, problems

    try:
        study, asked = examined(protocol, simulated=simulated)
        if rehearse:
            from labcrane.simulation.rehearsal import rehearse as rehearse_study

            asked += rehearse_study(study).questions
    except LabcraneError as error:
        if as_json:
            told = problems(error)
            said = [each["whole"] for each in told]
            typer.echo(json.dumps({"fine": False, "problems": said, "findings": told}))
        raise
    told = [about(study, each) for each in asked]
    if as_json:
        fine = {
            "fine": True,
            "problems": [],
            "warnings": [each["text"] for each in told],
            "findings": told,
            "study": study.protocol.study,
        }
        typer.echo(json.dumps(fine))
        return
    for each in told:
        typer.echo(each["whole"])
    sessions = len(study.protocol.sessions)
    done = ", and was rehearsed" if rehearse else ""
    if told:
        done += f"; {len(told)} warning{'s' if len(told) > 1 else ''} above"
    # One plain line, for which rich is not worth loading.
    typer.echo(
        f"{protocol}: study {study.protocol.study!r} is fine: {sessions} "
        f"session{'s' if sessions > 1 else ''} on the {study.machine.title}{done}"
    )
    if rehearse:
        from labcrane.simulation.foreseen import foreseen_tests, in_words

        if tests := in_words(foreseen_tests(study)):
            typer.echo(f"{protocol}: {tests}")


def examined(
    protocol: Path, *, simulated: bool = False
) -> "tuple[Study, tuple[CheckQuestion, ...]]":
    """Return a study and its warnings: the same for a terminal and a program.

    Raises
    ------
    LabcraneError
        With one line for every mistake.
    """
    from labcrane.approval.lock import lock_path
    from labcrane.files.names import COHORT
    from labcrane.files.system import is_there
    from labcrane.protocol.questions import questions
    from labcrane.protocol.study import load
    from labcrane.registry.registry import discover

    study = load(protocol, discover(study=protocol))
    study.check_installed(simulated=simulated, feedback=not simulated)
    if study.recordings and is_there(lock_path(protocol)):
        from labcrane.approval.lock import read_lock
        from labcrane.approval.recordings import check_consent_names

        check_consent_names(study, read_lock(protocol).consent)
    if is_there(cohort := protocol.resolve().with_name(COHORT)):
        from labcrane.simulation.population import read_population

        read_population(cohort, study)
    return study, questions(study)


def plan(
    protocol: ProtocolHere,
    participants: Annotated[
        int | None,
        typer.Option(help="number of participants to list; the planned number by default", min=1),
    ] = None,
    participant: Annotated[
        str | None, typer.Option(help="one participant only, by pseudonym")
    ] = None,
    export: Annotated[
        Path | None, typer.Option(help="also write the complete allocation to this CSV file")
    ] = None,
    data: DataBeside = None,
    as_json: AsJson = False,
) -> None:
    """Show blocks, each participant's order and the expected session duration."""
    from labcrane.cli.commands.approval import today
    from labcrane.design.allocation import allocate, as_csv
    from labcrane.design.plan import plan_session
    from labcrane.files.atomic import SHARED_FILE, write_text
    from labcrane.files.pseudonyms import pseudonyms
    from labcrane.participants.products import product
    from labcrane.protocol.effective import written_quantities
    from labcrane.protocol.questions import key_of

    study = study_of(protocol)
    count = participants or study.protocol.participants.planned
    names = [participant] if participant else pseudonyms(study.protocol.participants.pattern, count)
    plans = [
        [plan_session(study, name, number) for name in names]
        for number, _ in enumerate(study.protocol.sessions, start=1)
    ]
    allotments = allocate(study, dict.fromkeys(names))
    if export:
        where, place = data_folder(data, protocol), export.resolve()
        with product(where, "plan", place.parent, names, today()) as made:
            write_text(made.folder / place.name, as_csv(allotments), SHARED_FILE)
    lines = [] if participant else _balance(study, names)
    if as_json:
        rows = [_row(each) for session in plans for each in session]
        typer.echo(json.dumps({"sessions": rows, "balance": lines}, indent=1))
        return
    for each in written_quantities(study):
        if isinstance(each.written, str):
            line = f"{key_of(each.place)}: {each.written} is {each.value:g} {each.unit}"
            out.print(line, markup=False)
    for session in plans:
        _print(session)
    for line in lines:
        out.print(line, markup=False)
    if export:
        out.print(f"allocation: {export}", markup=False)


def pages(
    protocol: ProtocolHere,
    participant: Annotated[
        str | None, typer.Option(help="whose order is shown, by pseudonym; by default the first")
    ] = None,
    session: Annotated[int, typer.Option(help="which of the protocol's sessions", min=1)] = 1,
    port: Annotated[int, typer.Option(help="port of the pages; 0 selects a free one")] = 0,
) -> None:
    """Show each page of the participant in a browser: texts, consent, questionnaires."""
    from labcrane.cli.options import stay_on_this_computer
    from labcrane.design.plan import plan_session
    from labcrane.errors import PluginError
    from labcrane.files.pseudonyms import pseudonyms
    from labcrane.registry.offers import LAB, not_installed

    if missing := not_installed({"nicegui": LAB}):
        raise PluginError(f"the preview of the pages {missing}")
    stay_on_this_computer()
    from labcrane.web.handle import free_port
    from labcrane.web.preview import serve
    from labcrane.web.server.serving import HOST

    study = study_of(protocol)
    study.check_session(session)
    name = participant or pseudonyms(study.protocol.participants.pattern, 1)[0]
    plan = plan_session(study, name, session)
    out.print("Ctrl-C ends it", markup=False)
    serve(study, plan, free_port(HOST, port), lambda line: out.print(line, markup=False))


def _balance(study: "Study", names: "Sequence[str]") -> list[str]:
    """Return the balance; that of all who are planned, where fewer are listed."""
    from labcrane.design.allocation import allocate, balance
    from labcrane.files.pseudonyms import pseudonyms

    people = study.protocol.participants
    if len(names) >= people.planned:
        return balance(study, allocate(study, dict.fromkeys(names)))
    everyone = pseudonyms(people.pattern, people.planned)
    lines = balance(study, allocate(study, dict.fromkeys(everyone)))
    return [f"of all {people.planned} planned: {line}" for line in lines]


def _row(session: "SessionPlan") -> dict[str, object]:
    return {
        "participant": session.participant,
        "session": session.number,
        "name": session.name,
        "slot": session.slot,
        "seed": session.seed,
        "expected_s": session.expected_s,
        "steps": [
            {
                "number": step.number,
                "kind": step.kind,
                "block": step.block.number if step.block else None,
                "questionnaires": list(step.questionnaires),
                "expected_s": step.expected_s,
            }
            for step in session.steps
        ],
        "blocks": [
            {
                "number": block.number,
                "name": block.name,
                "practice": block.practice,
                "group": block.group,
                "condition": block.condition,
                "trials": sum(trial.planned.counted for trial in block.trials),
                "levels": {factor: list(levels) for factor, levels in block.levels.items()},
                "expected_s": block.expected_s,
                "track": _track_row(block),
            }
            for block in session.blocks
        ],
    }


def _track_row(block: "PlannedBlock") -> dict[str, object] | None:
    """Return what is known about levels that are chosen only while a session runs."""
    track = block.track
    if track is None:
        return None
    return {
        "name": track.name,
        "factor": track.settings.factor,
        "rounds": track.settings.rounds,
        "first": block.trials[0].planned.condition["track_level"],
        "levels": track.settings.levels,
    }


def _print(plans: "Sequence[SessionPlan]") -> None:
    from textwrap import fill

    whole = plans[0].expected_s / 60
    out.print(f"session {plans[0].number} {plans[0].name!r}: about {whole:.0f} minutes")
    for plan in plans:
        groups = {block.group for block in plan.blocks if block.group}
        group = f", group {', '.join(sorted(groups))}" if groups else ""
        out.print(f"{plan.participant}: slot {plan.slot}{group}, seed {plan.seed}", markup=False)
        for step in plan.steps:
            line = _block(step.block) if step.block else _other(step)
            width = out.console.width
            whole_line = fill(line, width, initial_indent="  ", subsequent_indent="    ")
            out.print(whole_line, markup=False)


def _block(block: "PlannedBlock") -> str:
    counted = sum(trial.planned.counted for trial in block.trials)
    practice = " (practice)" if block.practice else ""
    orders = [f"condition: {block.condition}"] * bool(block.condition)
    orders += [f"{factor}: {', '.join(levels)}" for factor, levels in block.levels.items()]
    asked = [f"after each: {', '.join(block.ask)}"] if block.ask else []
    about = f"{counted} trials, {block.expected_s / 60:.1f} minutes"
    if block.track is not None:
        orders, about = [_track(block, block.track), *orders], f"at most {about}"
    return f"block {block.number} {block.name}{practice}: {'; '.join([about, *orders, *asked])}"


def _track(block: "PlannedBlock", track: "PlannedTrack") -> str:
    """Describe a track in a block: its levels are not known before the session."""
    settings = track.settings
    first = block.trials[0].planned.condition["track_level"]
    by_number = sorted(settings.levels, key=settings.levels.__getitem__)
    goes_on = ", or where the session before came to" if settings.carry else ""
    return (
        f"{settings.factor} by track {track.name!r} ({settings.by}), from {by_number[0]} to "
        f"{by_number[-1]}, {settings.rounds} rounds at most, first {first}{goes_on}"
    )


def _other(step: "PlannedStep") -> str:
    """Describe a step without trials."""
    if step.kind == "break":
        return f"break of {step.seconds:g} s"
    if step.kind == "fixation":
        return f"fixation: {len(step.points)} points of {step.seconds:g} s"
    if step.questionnaires:
        return f"questionnaire: {', '.join(step.questionnaires)}"
    from textwrap import shorten

    return f"{step.kind}: {shorten(step.text, 60, placeholder=' ...')}"
