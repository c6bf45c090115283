"""Commands that work on recordings: export, report, replay."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from labcrane.cli.commands.approval import today
from labcrane.cli.options import stay_on_this_computer
from labcrane.cli.output import out
from labcrane.errors import ProtocolError, RecordingError

if TYPE_CHECKING:
    from labcrane.analysis.cohort import Cohort, Participant, Struck
    from labcrane.analysis.movements import Groups

DataFolder = Annotated[Path, typer.Argument(metavar="DATA", help="the study's data folder")]
Include = Annotated[
    list[str] | None,
    typer.Option(help="use also: simulated, pilot, half-finished; may be repeated"),
]
Workers = Annotated[int, typer.Option(help="processes on this computer", min=1)]
Scheduler = Annotated[
    str | None, typer.Option(help="a Dask scheduler whose workers do it: tcp://host:8786")
]
MANIFEST = "labcrane_export.json"


def export(
    data: DataFolder,
    to: Annotated[
        str, typer.Option(help="tables, matlab, bids, psychds, xdf; see labcrane plugins")
    ],
    folder: Annotated[Path, typer.Option("--out", help="a folder that is empty or new")],
    include: Include = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="NAME=VALUE of the exporter; may be repeated")
    ] = None,
    workers: Workers = 1,
    scheduler: Scheduler = None,
) -> None:
    """Export recordings for R, MATLAB, BIDS, Psych-DS or EEG programs."""
    from labcrane.analysis.exporter import Exporter
    from labcrane.analysis.movements import machine_of
    from labcrane.registry.call_monitor import CallMonitor
    from labcrane.registry.registry import discover

    registry = discover()
    offer = registry.find(Exporter, to)
    oversight = CallMonitor()
    plugin = registry.plugin(Exporter, to)
    place = oversight.place(f"exporter {to!r}", plugin, "export", offer.build)
    chosen = _settings(offer.settings, settings or [], to)
    if folder.exists() and any(folder.iterdir()):
        raise ProtocolError(f"{folder} is not empty, and nothing is overwritten; give a new folder")
    cohort = cohort_of(data.resolve() if scheduler else data, include)
    _, first = next(cohort.included[0].sessions())
    exporter = oversight.call(place, offer.build, chosen, machine_of(first))
    folder.mkdir(parents=True, exist_ok=True)
    people = _measured(cohort, workers, scheduler)
    with progress_bar(f"export to {to}", len(cohort.included)) as advance:
        oversight.call(place, exporter.export, _counted(people, advance), folder)
    _write_manifest(folder, to, chosen.model_dump(mode="json"), cohort)
    _keep_track(data, to, folder, cohort)
    out.print(f"{to}: {folder}", markup=False)


def _measured(cohort: "Cohort", workers: int, scheduler: str | None) -> "Sequence[Participant]":
    """Return the participants; with many workers their measures, most of the work, are done."""
    if workers == 1 and scheduler is None:
        return cohort.included
    from labcrane.analysis.measures import measure_ahead
    from labcrane.analysis.parallel import work

    with progress_bar("measure", len(cohort.included)) as advance:
        done = {}
        for person in work(measure_ahead, cohort.included, workers, scheduler):
            done[person.name] = person
            advance()
    return [done[person.name] for person in cohort.included]


def report(
    data: DataFolder,
    folder: Annotated[Path, typer.Option("--out", help="where the report goes")] = Path(
        "labcrane-report"
    ),
    include: Include = None,
    workers: Workers = 1,
    scheduler: Scheduler = None,
) -> None:
    """Write an HTML report of a study: figures, measures, statistics, quality."""
    from labcrane.analysis.report.report import write_report

    cohort = cohort_of(data.resolve() if scheduler else data, include)
    with progress_bar("report", len(cohort.included)) as advance:
        page = write_report(
            cohort,
            folder,
            progress=lambda done, of: advance(),
            workers=workers,
            scheduler=scheduler,
        )
    out.print(f"report: {page}", markup=False)


def replay(
    recording: Annotated[Path, typer.Argument(metavar="FILE", help="a participant file")],
    session: Annotated[int, typer.Option(help="which session")] = 1,
    speed: Annotated[
        float | None, typer.Option(help="show it over LSL, so many times as fast; 1 as it was")
    ] = None,
    protocol: Annotated[
        Path | None, typer.Option(help="run this protocol instead of the recorded one")
    ] = None,
    machine: Annotated[
        Path | None, typer.Option(help="operate this machine instead of the recorded one")
    ] = None,
    measures: Annotated[
        Path | None, typer.Option(help="write the measures of what was replayed as CSV")
    ] = None,
) -> None:
    """Run a recorded session again from its input, and compare every number."""
    from labcrane.replay.replay import replay as run_again

    if speed is not None:
        stay_on_this_computer()
    done = run_again(recording, session, protocol=protocol, machine=machine, speed=speed)
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
        + ("" if done.parts else "; no part that is recorded differs, so look at the plugins")
    )


def _write_measures(recording: Path, session: int, frames: "Groups", path: Path) -> None:
    """Write the measures of a session's movements in the ``frames`` of its replay."""
    from labcrane.analysis.measures import measure_session
    from labcrane.recording.participant_file.reader import open_recording

    record = open_recording(recording).session(session)
    measure_session(record, frames=frames).to_csv(path, index=False)
    out.print(f"measures: {path}", markup=False)


def cohort_of(data: Path, include: list[str] | None) -> "Cohort":
    """Return who counts in a study's data folder, and print who does not, and why."""
    from labcrane.analysis.cohort import find_cohort

    cohort = find_cohort(data, include or (), struck=_struck(data))
    for person in cohort.left_out:
        out.print(f"left out: {person.name}, {person.status}: {person.why}", markup=False)
    return cohort


def _struck(data: Path) -> "dict[str, Struck]":
    """Return whom the study's register says not to count, and why."""
    from labcrane.analysis.cohort import Status
    from labcrane.participants.folders import Places
    from labcrane.participants.register import read

    if not Places(data).register.exists():
        return {}
    register = read(Places(data))
    struck = {
        stone.participant: (Status.ERASED, f"on {stone.date}: {stone.reason}")
        for stone in register.tombstones
    }
    for name, entry in register.participants.items():
        if entry.exclusion is not None:
            why = f"on {entry.exclusion.date}: {entry.exclusion.reason}"
            struck[name] = (Status.EXCLUDED, why)
    return struck


def _keep_track(data: Path, to: str, folder: Path, cohort: "Cohort") -> None:
    """Note in the register where data of its participants went, for erasing and relabelling."""
    from labcrane.participants.copies import record_export
    from labcrane.participants.folders import Places

    if not Places(data).register.exists():
        return  # pilots and simulations only: nobody's data have gone anywhere
    names = [person.name for person in cohort.included]
    files = {}
    for path in (path for path in folder.rglob("*") if path.is_file()):
        inside = path.relative_to(folder)
        # A file that is named after somebody holds nobody else; a table may hold everybody.
        named = [name for name in names if name in str(inside)]
        files[inside] = named or names
    record_export(Places(data), to, folder, files, today())


@contextmanager
def progress_bar(what: str, total: int) -> Iterator[Any]:
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
    )

    parts = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*parts, console=out.console) as progress:
        task = progress.add_task(what, total=total)
        yield lambda: progress.advance(task)


def _counted(participants: "Sequence[Participant]", advance: Any) -> "Iterator[Participant]":
    for participant in participants:
        yield participant
        advance()


def _settings(model: Any, words: list[str], name: str) -> Any:
    """Return an exporter's settings from NAME=VALUE; values are YAML, as in a protocol."""
    from pydantic import ValidationError

    from labcrane.files.yaml import parse_yaml

    given = {}
    for word in words:
        key, separator, value = word.partition("=")
        if not separator:
            raise ProtocolError(f"--set {word!r} sets nothing; write NAME=VALUE")
        given[key] = parse_yaml(value, f"--set {key}")
    try:
        return model.model_validate(given)
    except ValidationError as error:
        known = ", ".join(model.model_fields) or "nothing"
        problems = "; ".join(
            f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors()
        )
        raise ProtocolError(f"exporter {name!r} can set {known}; {problems}") from None


def _write_manifest(folder: Path, to: str, settings: Any, cohort: "Cohort") -> None:
    """Write what was exported and who was left out beside the export, for erasure and for readers.

    BIDS and Psych-DS allow no further files, so it is hidden from them under ``.labcrane``.
    """
    import json
    from datetime import UTC, datetime

    from labcrane import __version__

    (folder / ".labcrane").mkdir()
    content = {
        "labcrane": __version__,
        "format": to,
        "settings": settings,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "data": cohort.folder.name,
        "participants": cohort.listing().to_dict("records"),
    }
    path = folder / ".labcrane" / MANIFEST
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
