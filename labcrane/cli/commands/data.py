"""Commands about participants' data: erase, relabel, transfer, merge."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.cli.commands.approval import today
from labcrane.cli.commands.participants import Reason, Someone
from labcrane.cli.options import DataOrHere, StudyFirst, data_in, first_study, one_study
from labcrane.cli.output import out
from labcrane.cli.typed import from_terminal
from labcrane.errors import ProtocolError
from labcrane.files.study_folder import data_of, protocol_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from labcrane.participants.copies import InventoryEntry, Reach
    from labcrane.participants.folders import Places


def where(study: StudyFirst, participant: Someone, data: DataOrHere = None) -> None:
    """List every place that holds a participant's data."""
    from labcrane.participants.copies import inventory
    from labcrane.participants.folders import Places
    from labcrane.recording.data_folder import DataFolder

    places = Places(one_study(data, data_in(first_study(study))))
    found = inventory(places, DataFolder.pseudonym(participant))  # as the register names it
    if not found:
        out.print(f"{places.root} and its register contain no data of {participant}", markup=False)
        return
    _list(found)


def erase(
    study: StudyFirst,
    participant: Someone,
    reason: Reason,
    yes: Annotated[bool, typer.Option("--yes", help="do not ask; for scripts")] = False,
    data: DataOrHere = None,
) -> None:
    """Erase a participant's data from everything labcrane wrote; an erasure record stays."""
    from labcrane.participants import recovery as unfinished
    from labcrane.participants.erasure import BEYOND
    from labcrane.participants.folders import Places

    places = Places(one_study(data, data_in(first_study(study))))
    if not yes:
        _confirm_erasure(places, participant)
    done = unfinished.erase(places, participant, reason, today())
    _say(done.reach)
    for path in done.mentions:
        out.print(f"still mentions {participant}: {path}", markup=False)
    for what in done.unsearched:
        out.print(f"cannot be searched for {participant}; check it yourself: {what}", markup=False)
    out.print(f"{participant} is erased. {BEYOND}", markup=False)


def _confirm_erasure(places: "Places", participant: str) -> None:
    """List what will be erased, and require the pseudonym as confirmation."""
    from labcrane.participants.copies import inventory

    found = inventory(places, participant)
    if not found:  # which erasing refuses
        return
    if not from_terminal():
        raise ProtocolError(
            f"erasing {participant} cannot be undone, and there is no terminal at which to ask; "
            f"labcrane where {participant} lists what would go, --yes erases it without asking"
        )
    _list(found)
    typed = typer.prompt(
        f"All data of {participant} in these places will be erased; type {participant} to confirm"
    )
    if typed != participant:
        raise ProtocolError(f"{typed!r} was typed, not {participant!r}; nothing was erased")


def _list(found: "Sequence[InventoryEntry]") -> None:
    from labcrane.cli.output import whole_table

    table = whole_table("what", "where", "state")
    for each in found:
        table.add_row(each.what, each.where, each.state)
    out.print(table)


def relabel(
    study: StudyFirst,
    participant: Someone,
    to: Annotated[str, typer.Argument(help="the correct pseudonym")],
    reason: Reason = "wrong number entered",
    data: DataOrHere = None,
) -> None:
    """Correct a wrong pseudonym in files, journals, register and exports."""
    from labcrane.participants import recovery as unfinished
    from labcrane.participants.folders import Places

    _say(
        unfinished.correct(
            Places(one_study(data, data_in(first_study(study)))), participant, to, reason, today()
        )
    )
    out.print(f"{participant} is {to} now; labcrane deviations says how it was run", markup=False)


def transfer(
    study: StudyFirst,
    to: Annotated[Path, typer.Argument(help="folder of the lab's storage")],
    data: DataOrHere = None,
) -> None:
    """Copy finished sessions to the lab's storage and verify both copies (SHA-256)."""
    from labcrane.participants import recovery as unfinished
    from labcrane.participants.folders import Places

    done = unfinished.move(Places(one_study(data, data_in(first_study(study)))), to)
    out.print(
        f"{len(done.copied)} files copied; {done.equal} files are equal on both sides (SHA-256)"
    )
    for line in done.only_here:
        out.print(f"only here: {line}", markup=False)


def merge(
    study: StudyFirst,
    other: Annotated[Path, typer.Argument(help="the other laboratory's study, or its data folder")],
    data: DataOrHere = None,
) -> None:
    """Take recordings and register of another laboratory's data folder of the same study."""
    from labcrane.participants import recovery as unfinished
    from labcrane.participants.folders import Places

    given = first_study(study)
    places, there = Places(one_study(data, data_in(given))), Places(data_of(other))
    done = unfinished.join(places, there, today(), *_approved(given or places.root))
    for what, names in (
        ("taken from there", done.taken),
        ("here already, equal", done.equal),
        ("only there, since pilots and simulations are not taken", done.only_there),
    ):
        if names:
            out.print(f"{what}: {', '.join(names)}", markup=False)
    if not done.taken:
        out.print(f"nothing new in the register of {there.root}", markup=False)
    for slot, holders in done.shared.items():
        out.print(
            f"slot {slot}: {' and '.join(holders)} keep it, with the group and rows under which "
            "they are run",
            markup=False,
        )
    if done.taken:
        out.print(f"{there.root} is unchanged; erase and relabel do not reach it", markup=False)


def _approved(study: Path) -> tuple[frozenset[str] | None, str]:
    """Return the seals of a study's lock and of those that it replaced, and the study's name.

    None and "" without a lock.
    """
    from labcrane.approval.lock import lock_path, read_lock

    try:
        protocol = protocol_of(study)
    except ProtocolError:  # data alone
        return None, ""
    if not lock_path(protocol).is_file():
        return None, ""
    lock = read_lock(protocol)
    return lock.replaced | {lock.seal}, str(lock.content["study"])


def _say(reach: "Reach") -> None:
    for path in reach.removed:
        out.print(f"removed: {path}", markup=False)
    for path in reach.changed:
        out.print(f"changed: {path}", markup=False)
    for what in reach.again:
        out.print(
            f"removed, since it was computed from all participants' data; make it again: {what}",
            markup=False,
        )
    for owed in reach.owed:
        if owed.link:
            out.print(
                f"a link, which is not followed; remove its target, then the link: {owed.folder}",
                markup=False,
            )
            continue
        out.print(
            f"cannot be reached now; the next erase, relabel or transfer that finds it completes "
            f"it: {owed.folder}",
            markup=False,
        )
