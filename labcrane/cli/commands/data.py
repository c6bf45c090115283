"""Commands about participants' data: erase, relabel, transfer."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.cli.commands.approval import today
from labcrane.cli.commands.participants import HERE, Data, Reason, Someone
from labcrane.cli.output import out

if TYPE_CHECKING:
    from labcrane.participants.copies import Reach


def where(participant: Someone, data: Data = HERE) -> None:
    """List every place that holds a participant's data."""
    from labcrane.cli.output import whole_table
    from labcrane.participants.folders import Places
    from labcrane.participants.inventory import inventory

    found = inventory(Places(data), participant)
    if not found:
        out.print(f"nothing of {participant} is in {data}, nor known to its register", markup=False)
        return
    table = whole_table("what", "where", "state")
    for each in found:
        table.add_row(each.what, each.where, each.state)
    out.print(table)


def erase(participant: Someone, reason: Reason, data: Data = HERE) -> None:
    """Remove a participant's data from everything labcrane wrote; a tombstone stays."""
    from labcrane.participants import recovery as unfinished
    from labcrane.participants.erasure import BEYOND
    from labcrane.participants.folders import Places

    done = unfinished.erase(Places(data), participant, reason, today())
    _say(done.reach)
    for path in done.mentions:
        out.print(f"still mentions {participant}: {path}", markup=False)
    for what in done.unsearched:
        out.print(
            f"cannot be searched for {participant}; open it yourself, and see: {what}", markup=False
        )
    out.print(f"{participant} is erased. {BEYOND}", markup=False)


def relabel(
    participant: Someone,
    to: Annotated[str, typer.Argument(help="the right pseudonym")],
    reason: Reason = "wrong number entered",
    data: Data = HERE,
) -> None:
    """Repair a wrong participant number in files, journals, register and exports."""
    from labcrane.participants import recovery as unfinished
    from labcrane.participants.folders import Places

    _say(unfinished.correct(Places(data), participant, to, reason, today()))
    out.print(f"{participant} is {to} now; labcrane deviations says how it was run", markup=False)


def transfer(
    to: Annotated[Path, typer.Argument(help="folder of the lab's store")], data: Data = HERE
) -> None:
    """Copy finished sessions to the lab's store, and prove that both sides are equal."""
    from labcrane.participants import recovery as unfinished
    from labcrane.participants.folders import Places

    done = unfinished.move(Places(data), to)
    out.print(
        f"{len(done.copied)} files copied; {done.equal} files are equal on both sides (SHA-256)"
    )
    for line in done.only_here:
        out.print(f"only here: {line}", markup=False)


def _say(reach: "Reach") -> None:
    for path in reach.removed:
        out.print(f"removed: {path}", markup=False)
    for path in reach.changed:
        out.print(f"changed: {path}", markup=False)
    for what in reach.again:
        out.print(
            f"removed, since it was worked out of everybody's data; make it again: {what}",
            markup=False,
        )
    for owed in reach.owed:
        if owed.link:
            out.print(
                f"a link, which is not followed; remove what is behind it, then the link: "
                f"{owed.folder}",
                markup=False,
            )
            continue
        out.print(
            f"cannot be reached now, and is done by the next call of erase, relabel or transfer "
            f"that finds it: {owed.folder}",
            markup=False,
        )
