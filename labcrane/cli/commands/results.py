"""Commands that work on recordings: export, report, replay."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from labcrane.cli.commands.approval import today
from labcrane.cli.options import StudyData, protocol_in, stay_on_this_computer
from labcrane.cli.output import out
from labcrane.errors import PluginError, ProtocolError, RecordingError, StorageError

if TYPE_CHECKING:
    from labcrane.analysis.cohort import Cohort, Participant
    from labcrane.analysis.movements import Groups
    from labcrane.analysis.unusable import Unusable
    from labcrane.participants.products import Product

Include = Annotated[
    list[str] | None,
    typer.Option(help="also use: simulated, pilot, half-finished; may be repeated"),
]
WorkersOrCores = Annotated[
    int | None,
    typer.Option(
        help="processes on this computer; by default one per core if there are enough participants",
        min=1,
    ),
]
Scheduler = Annotated[str | None, typer.Option(help="address of a Dask scheduler: tcp://host:8786")]
AcceptUnprobed = Annotated[
    bool,
    typer.Option(
        "--accept-unprobed", help="also use streams whose clock offset was never measured"
    ),
]

LEFT_OUT = 3
"""Exit status if the command succeeded but left out unusable recordings."""


def export(
    data: StudyData,
    to: Annotated[
        str,
        typer.Option(help="tables, matlab, bids, psychds, xdf, zip; see labcrane plugins"),
    ],
    folder: Annotated[Path, typer.Option("--out", help="an empty or new folder")],
    include: Include = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="NAME=VALUE of the exporter; may be repeated")
    ] = None,
    workers: WorkersOrCores = None,
    scheduler: Scheduler = None,
    accept_unprobed: AcceptUnprobed = False,
) -> None:
    """Export recordings for R, MATLAB, BIDS, Psych-DS or EEG programs."""
    from labcrane.analysis.exporter import Exporter
    from labcrane.analysis.movements import machine_of
    from labcrane.analysis.quality import check_probed
    from labcrane.analysis.unusable import Unusable
    from labcrane.participants.products import check_empty
    from labcrane.registry.call_monitor import CallMonitor
    from labcrane.registry.registry import discover

    registry = discover()
    offer = registry.find(Exporter, to)
    call_monitor = CallMonitor()
    plugin = registry.plugin(Exporter, to)
    place = call_monitor.place(f"exporter {to!r}", plugin, "export", offer.build)
    chosen = _settings(offer.settings, settings or [], to)
    check_empty(folder)  # before anything is measured
    cohort = cohort_of(data.resolve() if scheduler else data, include)
    unknown = check_probed(cohort.included, accept=accept_unprobed)
    _, first = next(cohort.included[0].sessions())
    exporter = call_monitor.call(place, offer.build, chosen, machine_of(first))

    def attempt(cohort: "Cohort") -> None:
        people = _Read(_measured(cohort, workers, scheduler))
        with (
            _product(data, to, folder, cohort, shared=exporter.shared, empty=True) as made,
            progress_bar(f"export to {to}", len(cohort.included)) as advance,
        ):
            handed = made.handing_out((person.name, person) for person in people.counted(advance))
            try:
                call_monitor.call(place, exporter.export, handed, made.folder)
            except RecordingError as error:
                if people.now is None:  # no participant's data were being read
                    raise
                raise _UnusableError(people.now, Unusable.of(error)) from error
            except PluginError as error:
                if isinstance(error.__cause__, OSError) and error.__cause__.errno:
                    raise StorageError.of(error.__cause__) from error
                raise
            _write_manifest(made.folder, to, chosen.model_dump(mode="json"), cohort, unknown)

    cohort = _without_bad(attempt, cohort)
    out.print(f"{to}: {folder}", markup=False)
    _tell_left_out(cohort)


class _UnusableError(Exception):
    """One participant's data stopped an output for all; the rest is done without."""

    def __init__(self, name: str, why: "Unusable") -> None:
        super().__init__(name, why)
        self.name, self.why = name, why


class _Read:
    """Hands out participants, and knows whose data are being read now."""

    def __init__(self, people: "Sequence[Participant]") -> None:
        self._people = people
        self.now: str | None = None

    def counted(self, advance: Any) -> "Iterator[Participant]":
        for person in self._people:
            self.now = person.name
            yield person
            advance()
        self.now = None


def _without_bad(attempt: "Callable[[Cohort], None]", cohort: "Cohort") -> "Cohort":
    """Do something with a cohort; drop and name participants whose data cannot be used."""
    while True:
        try:
            attempt(cohort)
        except _UnusableError as bad:
            cohort = _leave_out(cohort, bad.name, bad.why)
        else:
            return cohort


def _leave_out(cohort: "Cohort", name: str, why: "Unusable") -> "Cohort":
    out.print(f"left out: {name}, cannot be used: {why.why}", markup=False)
    if why.trace:
        typer.echo(why.trace, err=True)
    return cohort.without(name, why.status, why.why)


def _tell_left_out(cohort: "Cohort") -> None:
    """Print how many recordings cannot be used, and end with their exit code."""
    if not cohort.unreadable:
        return
    names = ", ".join(person.name for person in cohort.unreadable)
    out.print(f"{len(cohort.unreadable)} recordings cannot be used: {names}", markup=False)
    raise typer.Exit(LEFT_OUT)


def _measured(
    cohort: "Cohort", workers: int | None, scheduler: str | None
) -> "Sequence[Participant]":
    """Return the participants; several workers compute their measures first."""
    from labcrane.analysis.parallel import usual_workers, work

    workers = workers or usual_workers(len(cohort.included))
    if workers == 1 and scheduler is None:
        return cohort.included
    from labcrane.analysis.measures import measure_or_say_why
    from labcrane.analysis.unusable import Unusable

    with progress_bar("measure", len(cohort.included)) as advance:
        done = {}
        for name, person in work(measure_or_say_why, cohort.included, workers, scheduler):
            if isinstance(person, Unusable):
                raise _UnusableError(name, person)
            done[name] = person
            advance()
    return [done[person.name] for person in cohort.included]


def report(
    data: StudyData,
    folder: Annotated[Path, typer.Option("--out", help="folder for the report")] = Path(
        "labcrane-report"
    ),
    include: Include = None,
    workers: WorkersOrCores = None,
    scheduler: Scheduler = None,
    accept_unprobed: AcceptUnprobed = False,
) -> None:
    """Write an HTML report of a study: figures, measures, statistics, quality."""
    from labcrane.analysis.parallel import usual_workers
    from labcrane.analysis.quality import check_probed
    from labcrane.analysis.report.report import write_report
    from labcrane.simulation.track_cohort import judged

    cohort = cohort_of(data.resolve() if scheduler else data, include)
    unknown = check_probed(cohort.included, accept=accept_unprobed)

    def leave_out(name: str, why: "Unusable") -> None:
        nonlocal cohort
        cohort = _leave_out(cohort, name, why)

    with (
        _product(data, "report", folder, cohort, whole=True) as made,
        progress_bar("report", len(cohort.included)) as advance,
    ):
        page = write_report(
            cohort,
            made.folder,
            leave_out=leave_out,
            progress=lambda done, of: advance(),
            workers=workers or usual_workers(len(cohort.included)),
            scheduler=scheduler,
            unprobed=unknown,
            judge=judged,
        )
    out.print(f"report: {folder / page.name}", markup=False)
    _tell_left_out(cohort)


def replay(
    recording: Annotated[Path, typer.Argument(metavar="FILE", help="a participant file")],
    session: Annotated[int, typer.Option(help="which session")] = 1,
    speed: Annotated[
        float | None, typer.Option(help="show it over LSL at this speed; 1 is the recorded speed")
    ] = None,
    show: Annotated[
        bool, typer.Option(help="present it in the study's views and sounds instead")
    ] = False,
    begin: Annotated[float, typer.Option("--from", help="second to start at")] = 0.0,
    protocol: Annotated[
        Path | None,
        typer.Option(help="run this protocol instead of the recorded one", callback=protocol_in),
    ] = None,
    machine: Annotated[
        Path | None, typer.Option(help="operate this machine instead of the recorded one")
    ] = None,
    measures: Annotated[
        Path | None, typer.Option(help="write the measures of the replay as CSV")
    ] = None,
    run_recorded_code: Annotated[
        bool,
        typer.Option(
            "--run-recorded-code",
            help="import plugins that are in the file; use it for trusted files only",
        ),
    ] = False,
) -> None:
    """Re-run a recorded session from its input and compare every number."""
    from labcrane.replay.replay import replay_session as run_again

    if speed is not None and not speed > 0.0:
        raise ProtocolError(f"a speed of {speed:g} is not possible; give one above 0")
    if show:
        pace = 1.0 if speed is None else speed
        _show(recording, session, protocol, pace, begin, run_code=run_recorded_code)
        return
    if begin:
        raise ProtocolError("--from needs --show; add it")
    if speed is not None:
        stay_on_this_computer()
    done = run_again(
        recording,
        session,
        protocol=protocol,
        machine=machine,
        speed=speed,
        run_code=run_recorded_code,
    )
    for part in done.parts:
        out.print(f"differs: {part}", markup=False)
    if measures is not None:
        _write_measures(recording, session, done.frames, measures)
    if done.difference is None:
        out.print(f"{done.ticks} ticks replayed, every number the same bit for bit", markup=False)
        return
    first = done.difference
    raise RecordingError(
        f"tick {first.tick} is the first that differs: {first.column} was {first.recorded!r} and "
        f"is {first.replayed!r}"
        + ("" if done.parts else "; no recorded part differs, so check the plugins")
    )


def _show(
    recording: Path,
    session: int,
    protocol: Path | None,
    speed: float,
    begin: float,
    *,
    run_code: bool,
) -> None:
    """Show a recorded session in the views and sounds of its study."""
    from tempfile import TemporaryDirectory

    from labcrane.feedback.playback import play
    from labcrane.recording.participant_file.reader import open_recording
    from labcrane.replay.restore import restored_study

    stay_on_this_computer()
    record = open_recording(recording).session(session)
    with TemporaryDirectory(prefix="labcrane-show-") as folder:
        study = restored_study(record, Path(folder), protocol, run_code=run_code)
        play(study, record, speed=speed, start_s=begin, say=out.print)


def view(
    recording: Annotated[
        Path, typer.Argument(metavar="FILE", help="a participant file, or the folder with journals")
    ],
    session: Annotated[int, typer.Option(help="which session")] = 1,
    beside: Annotated[
        Path | None, typer.Option(help="another participant file, shown in parallel")
    ] = None,
    at: Annotated[str, typer.Option(help="second to start at, or an event: target.entered")] = "0",
    codes: Annotated[
        Path | None, typer.Option(help="YAML file with keys that annotate what is seen")
    ] = None,
    coder: Annotated[str, typer.Option(help="abbreviation of who annotates")] = "",
    trial: Annotated[
        int | None, typer.Option(help="start at this trial, by its number in the trial table")
    ] = None,
    beside_trial: Annotated[
        int | None, typer.Option(help="also show this trial; both run from their starts")
    ] = None,
    port: Annotated[int, typer.Option(help="port of the page; 0 selects a free one")] = 0,
) -> None:
    """Show a recorded session in a browser: machine, timeline, signals, events."""
    from tempfile import TemporaryDirectory

    from labcrane.registry.offers import LAB, not_installed
    from labcrane.registry.registry import discover

    if missing := not_installed({"nicegui": LAB}):
        raise PluginError(f"the viewer {missing}")
    from labcrane.recording.paths import participant_path
    from labcrane.web.handle import free_port
    from labcrane.web.server.serving import HOST
    from labcrane.web.viewer.codes import Opening, read_codes
    from labcrane.web.viewer.film import Film
    from labcrane.web.viewer.opened import opened
    from labcrane.web.viewer.viewer import serve

    stay_on_this_computer()

    def say(line: str) -> None:
        out.print(line, markup=False)

    scheme = read_codes(codes) if codes else ()
    if beside_trial is not None and trial is None:
        raise ProtocolError("--beside-trial needs --trial; add it")
    paths = [recording, *([beside or recording] if beside or beside_trial is not None else [])]
    with TemporaryDirectory(prefix="labcrane-view-") as scratch:
        films = [
            Film(
                opened(path, session, Path(scratch) / str(number), say),
                path.stem,
                (participant_path(path) if path.is_dir() else path, session),
            )
            for number, path in enumerate(paths)
        ]
        second = films[0].time_of(at) if trial is None else films[0].start_of(trial)
        if beside_trial is not None:
            films[1].shift = films[1].start_of(beside_trial) - second
            films[0].called += f", trial {trial}"
            films[1].called += f", trial {beside_trial}"
        say("Ctrl-C ends it")
        serve(films, discover(), free_port(HOST, port), Opening(second, coder, scheme), say)


def _write_measures(recording: Path, session: int, frames: "Groups", path: Path) -> None:
    """Write the measures of a session's movements in the ``frames`` of its replay."""
    from labcrane.analysis.measures import measure_session
    from labcrane.participants.products import written_about
    from labcrane.recording.participant_file.reader import open_recording

    record = open_recording(recording).session(session)
    with written_about(recording, "replay", path) as beside:
        measure_session(record, frames=frames).to_csv(beside, index=False)
    out.print(f"measures: {path}", markup=False)


def cohort_of(data: Path, include: list[str] | None) -> "Cohort":
    """Return the included participants of a data folder, and print the others with reasons."""
    from labcrane.analysis.cohort import find_cohort
    from labcrane.participants.folders import Places
    from labcrane.participants.register import struck, unregistered

    places = Places(data)
    strangers = unregistered(places)
    cohort = find_cohort(data, include or (), struck=struck(places), unregistered=strangers)
    for person in cohort.left_out:
        out.print(f"left out: {person.name}, {person.status}: {person.why}", markup=False)
    for person in cohort.included:
        if person.name in strangers:
            out.print(f"used: {person.name}, {strangers[person.name]}", markup=False)
    return cohort


def _product(
    data: Path,
    writer: str,
    folder: Path,
    cohort: "Cohort",
    *,
    shared: Sequence[str] = (),
    whole: bool = False,
    empty: bool = False,
) -> "AbstractContextManager[Product]":
    """Return an output folder that the register knows; see :mod:`~.participants.products`.

    It lists the participants who were left out, with reasons.
    """
    from labcrane.analysis.cohort import Status
    from labcrane.participants.products import product

    people = [*cohort.included, *cohort.left_out]
    names = [person.name for person in people if person.status is not Status.ERASED]
    return product(data, writer, folder, names, today(), shared=shared, whole=whole, empty=empty)


@contextmanager
def progress_bar(what: str, total: int) -> Iterator[Any]:
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    parts = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*parts, console=out.console) as progress:
        task = progress.add_task(what, total=total)
        yield lambda: progress.advance(task)


def _settings(model: Any, words: list[str], name: str) -> Any:
    """Return an exporter's settings from NAME=VALUE; values are YAML, as in a protocol."""
    from pydantic import ValidationError

    from labcrane.files.complaints import told
    from labcrane.files.yaml import parse_yaml

    given = {}
    for word in words:
        key, separator, value = word.partition("=")
        if not separator:
            raise ProtocolError(f"--set {word!r} is not an assignment; write NAME=VALUE")
        given[key] = parse_yaml(value, f"--set {key}")
    try:
        return model.model_validate(given)
    except ValidationError as error:
        known = ", ".join(model.model_fields) or "nothing"
        problems = "; ".join(one.message for one in told(error.errors(), (name,), model))
        raise ProtocolError(
            f"{problems}; write --set NAME=VALUE, where {name} has {known}"
        ) from None


def _write_manifest(
    folder: Path, to: str, settings: Any, cohort: "Cohort", unprobed: list[str]
) -> None:
    """Write an export's contents and left-out participants next to it, for erasure and readers.

    BIDS and Psych-DS do not allow further files, so they are hidden under ``.labcrane``.
    """
    from datetime import UTC, datetime

    from labcrane import __version__
    from labcrane.participants.copies import write_manifest

    content = {
        "labcrane": __version__,
        "format": to,
        "settings": settings,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "data": cohort.folder.name,
        "participants": cohort.listing().to_dict("records"),
        "unprobed": unprobed,
    }
    write_manifest(folder, content)
