"""Commands about participants: the register, consent, deviations."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.cli.commands.approval import today
from labcrane.cli.options import (
    STUDY,
    DataBeside,
    DataOrHere,
    StudyFirst,
    StudyOrHere,
    data_folder,
    data_in,
    first_study,
    one_study,
    stay_on_this_computer,
)
from labcrane.cli.output import out, print_rows, whole_table
from labcrane.files.study_folder import protocol_of

if TYPE_CHECKING:
    from labcrane.participants.folders import Places

Someone = Annotated[str, typer.Argument(metavar="PARTICIPANT", help="pseudonym: P001")]
Reason = Annotated[str, typer.Option(help="why; no names")]


def participants(study: StudyOrHere = None, data: DataOrHere = None) -> None:
    """Show the register: slots, sessions and how they ended, consent, exclusions."""
    from labcrane.participants.folders import Places
    from labcrane.participants.register import read, unregistered

    places = Places(one_study(data, study))
    register = read(places)
    titles = ("participant", "slot", "group", "seed", "consent", "sessions", "excluded")
    rows = [
        (
            name,
            f"{entry.slot}{'' if entry.holds_slot else ' (free)'}",
            entry.group or "-",
            str(entry.seed),
            ", ".join(
                f"{consent.file} (version {consent.version}) {consent.date}"
                for consent in entry.consent
            )
            or "-",
            ", ".join(
                f"{sitting.session} {sitting.date} {_ended(places, name, sitting.session)}"
                for sitting in entry.sessions
            )
            or "-",
            f"{entry.exclusion.date}: {entry.exclusion.reason}" if entry.exclusion else "-",
        )
        for name, entry in sorted(register.participants.items())
    ]
    if rows:
        print_rows(titles, rows)
    else:
        out.print(f"nobody is enrolled in {places.root}", markup=False)
    for name, entry in sorted(register.participants.items()):
        for text in entry.notes:
            out.print(f"{name}: {text}", markup=False)
    for name, why in unregistered(places).items():
        out.print(f"{name}: {why}", markup=False)
    for stone in register.tombstones:
        out.print(f"{stone.participant} erased on {stone.date}: {stone.reason}", markup=False)
    for export in register.exports:
        out.print(f"export {export.exporter} of {export.date}: {export.folder}", markup=False)


def _ended(places: "Places", participant: str, session: int) -> str:
    """Return how a session ended, as its participant file has it now."""
    from labcrane.analysis.cohort import unfinished
    from labcrane.errors import RecordingError
    from labcrane.recording.participant_file.reader import Recording
    from labcrane.recording.participant_file.recover import backlog
    from labcrane.recording.paths import journal_path, participant_path, parts

    folder = places.raw(participant)
    path = participant_path(folder)
    try:
        recording = Recording(path) if path.exists() else None
        if recording is not None and session in recording.sessions:
            ended = unfinished(recording.session(session)) or "complete"
            behind = backlog(path).get(session)
            return f"{ended}, as far as the file goes ({behind})" if behind else ended
        if not parts(journal_path(folder, session, "run")):
            return (
                "did not start: nothing of it is recorded; labcrane run --participant "
                f"{participant} begins it"
            )
        if recording is not None:
            return backlog(path)[session]
    except RecordingError as error:
        return f"cannot be read: {error}"
    return (
        "without participant file: still running, or was killed; labcrane resume --participant "
        f"{participant} continues it, and labcrane recover {folder} builds the file"
    )


def consent(
    study: StudyFirst,
    participant: Someone,
    beyond_planned: Annotated[
        bool,
        typer.Option("--beyond-planned", help="enrol more than planned; recorded as a deviation"),
    ] = False,
    data: DataBeside = None,
) -> None:
    """Confirm a participant's consent to the approved text, and enrol the participant."""
    from labcrane.approval.decision import verify
    from labcrane.participants.enrolment import confirm_consent
    from labcrane.participants.folders import Places
    from labcrane.participants.register import read
    from labcrane.protocol.study import load
    from labcrane.registry.registry import discover

    protocol = protocol_of(first_study(study) or Path())
    registry = discover(study=protocol)
    loaded = load(protocol, registry)
    lock = verify(loaded, registry, today())
    text = (lock.approval["consent"], lock.consent_version)
    places = Places(data_folder(data, protocol))
    lock.check_before(read(places).locks)
    entry = confirm_consent(
        places, loaded, participant, text, today(), beyond_planned=beyond_planned
    )
    group = f", group {entry.group}" if entry.group else ""
    out.print(
        f"{participant} has consented to {text[0]} (version {text[1]}); slot {entry.slot}{group}, "
        f"seed {entry.seed}",
        markup=False,
    )


def exclude(
    study: StudyFirst,
    participant: Someone,
    reason: Reason,
    keep_slot: Annotated[
        bool, typer.Option("--keep-slot", help="do not release the slot to another participant")
    ] = False,
    data: DataOrHere = None,
) -> None:
    """Exclude a participant (dropout or unusable data) and release the slot."""
    from labcrane.participants import enrolment
    from labcrane.participants.folders import Places

    enrolment.exclude(
        Places(one_study(data, data_in(first_study(study)))),
        participant,
        reason,
        today(),
        keep_slot=keep_slot,
    )
    out.print(f"{participant} is excluded", markup=False)


def note(
    study: StudyFirst,
    participant: Someone,
    text: Annotated[str, typer.Argument(help="the note; no names")],
    data: DataOrHere = None,
) -> None:
    """Add a note about a participant (no names)."""
    from labcrane.participants import enrolment
    from labcrane.participants.folders import Places

    enrolment.note(Places(one_study(data, data_in(first_study(study)))), participant, text)


def waive(
    study: StudyFirst,
    participant: Someone,
    reason: Reason,
    session: Annotated[int, typer.Option(help="which session", min=2)],
    data: DataOrHere = None,
) -> None:
    """Allow a session outside its time window; recorded as a deviation."""
    from labcrane.participants import enrolment
    from labcrane.participants.folders import Places

    enrolment.waive(
        Places(one_study(data, data_in(first_study(study)))), participant, session, reason, today()
    )


def deviations(study: StudyOrHere = None, data: DataOrHere = None) -> None:
    """List protocol deviations, with trials by their numbers in the trial table."""
    from labcrane.participants.deviations import all_deviations
    from labcrane.participants.folders import Places

    found = all_deviations(Places(one_study(data, study)))
    table = whole_table("participant", "session", "trial", "what", "detail")
    for name, deviation in found:
        where = [str(number) if number else "-" for number in (deviation.session, deviation.trial)]
        table.add_row(name, *where, deviation.what, deviation.detail)
    out.print(table if found else "no deviations")


def study(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="STUDY",
            help=STUDY,
            default_factory=Path,
            show_default="here",
        ),
    ],
    port: Annotated[int, typer.Option(help="port of the page; 0 selects a free one")] = 0,
) -> None:
    """Show a study in a browser: who is due, groups, quality, deviations, consent, disk."""
    from labcrane.errors import PluginError
    from labcrane.registry.offers import LAB, not_installed
    from labcrane.registry.registry import discover

    if missing := not_installed({"nicegui": LAB}):
        raise PluginError(f"the study's page {missing}")
    from labcrane.web.handle import free_port
    from labcrane.web.server.serving import HOST
    from labcrane.web.study.overview import Reader
    from labcrane.web.study.service import serve

    stay_on_this_computer()
    reader = Reader.of(folder)
    reader.overview(today())  # what cannot be read is said here, not in a browser
    out.print("Ctrl-C ends it", markup=False)
    serve(reader, discover, free_port(HOST, port), lambda line: out.print(line, markup=False))
