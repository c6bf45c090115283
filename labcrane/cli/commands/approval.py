"""Commands about approval: approve, amend, methods."""

from datetime import date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.cli.options import ProtocolHere
from labcrane.cli.output import out
from labcrane.errors import ProtocolError

if TYPE_CHECKING:
    from labcrane.protocol.study import Study


def approve(
    protocol: ProtocolHere,
    board: Annotated[str, typer.Option(help="the board that approved the study")],
    reference: Annotated[str, typer.Option(help="the board's reference number of the approval")],
    valid_until: Annotated[str, typer.Option(help="last day on which people may take part")],
    consent: Annotated[Path, typer.Option(help="the consent text, in the protocol's folder")],
) -> None:
    """Rehearse a protocol, then lock it with everything it refers to, as approved.

    Nothing is locked while check or the rehearsal raises a warning.
    """
    from labcrane.approval import decision
    from labcrane.protocol.study import load
    from labcrane.registry.registry import discover

    registry = discover(study=protocol)
    grant = decision.Grant(board, reference, read_date(valid_until), consent)
    study = load(protocol, registry)
    _rehearse(study)
    lock = decision.approve(study, registry, grant, today())
    materials = lock.content["materials"]
    files = ", ".join(materials["files"]) or "no files"
    out.print(
        f"{lock.path}: approved until {valid_until}; locked: the protocol, {files}, "
        f"{lock.approval['consent']} (version {lock.consent_version}), labcrane "
        f"{materials['labcrane']['version']} and the plugins {', '.join(materials['plugins'])}",
        markup=False,
    )


def _rehearse(study: "Study") -> None:
    """Rehearse a study before it is locked: later answers to warnings would be amendments.

    Raises
    ------
    ProtocolError
        The study raises warnings.
    """
    from labcrane.protocol.questions import about, questions
    from labcrane.simulation.rehearsal import rehearse

    open_ones = (*questions(study), *rehearse(study).questions)
    if open_ones:
        asked = [about(study, each)["whole"] for each in open_ones]
        last = "nothing was locked; answer the warnings above first"
        raise ProtocolError("\n".join([*asked, last]))


def amend(
    protocol: ProtocolHere,
    why: Annotated[str, typer.Option(help="why it was changed")],
    reference: Annotated[str, typer.Option(help="the board's reference number of the amendment")],
    board: Annotated[str | None, typer.Option(help="as before by default")] = None,
    valid_until: Annotated[str | None, typer.Option(help="as before by default")] = None,
    consent: Annotated[Path | None, typer.Option(help="as before by default")] = None,
) -> None:
    """Record changes to an approved study and keep its history."""
    from labcrane.approval import decision
    from labcrane.approval.lock import read_lock
    from labcrane.protocol.study import load
    from labcrane.registry.registry import discover

    registry, old = discover(study=protocol), read_lock(protocol)
    grant = decision.Grant(
        board or old.approval["board"],
        reference,
        read_date(valid_until or old.approval["valid_until"]),
        consent or old.consent,
    )
    study = load(protocol, registry)
    _rehearse(study)
    lock = decision.amend(study, registry, grant, why, today())
    entry = lock.amendments[-1]
    out.print(f"{lock.path}: amendment {entry['number']}:", markup=False)
    for change in entry["changes"]:
        out.print(f"  {change}", markup=False)


def methods(
    protocol: ProtocolHere,
    codebook: Annotated[Path | None, typer.Option(help="the codebook's path: a CSV file")] = None,
    planned: Annotated[
        bool, typer.Option("--planned", help="of a study before its approval: a preregistration")
    ] = False,
) -> None:
    """Write the Methods paragraph and the codebook of an approved study."""
    from labcrane.approval import decision
    from labcrane.approval.codebook import as_csv
    from labcrane.approval.lock import read_lock
    from labcrane.approval.methods import methods as paragraph
    from labcrane.files.atomic import SHARED_FILE, write_text
    from labcrane.protocol.study import load
    from labcrane.registry.registry import discover

    if planned:
        registry = discover(study=protocol)
        lock = decision.planned(load(protocol, registry), registry)
    else:
        lock = read_lock(protocol)
    path = codebook or protocol.with_name(f"{protocol.stem}.codebook.csv")
    out.print(paragraph(lock), markup=False)
    write_text(path, as_csv(lock.content["codebook"]), SHARED_FILE)
    out.print(f"codebook: {path}", markup=False)


def read_date(text: str) -> date:
    """Read a date as people type it."""
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise ProtocolError(f"{text!r} is not a date; write it as 2027-12-31") from None


def today() -> date:
    """Return the local date."""
    return datetime.now().astimezone().date()
