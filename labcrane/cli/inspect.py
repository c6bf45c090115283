"""Commands that look and run nothing: check, plan, plugins."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

ProtocolPath = Annotated[Path, typer.Argument(metavar="PROTOCOL", help="the study's YAML file")]

out = Console(soft_wrap=True, highlight=False)


def whole_table(*titles: str) -> Table:
    """Return a table that breaks what does not fit, and cuts nothing off."""
    table = Table()
    for title in titles:
        table.add_column(title, overflow="fold")
    return table


def check(protocol: ProtocolPath) -> None:
    """Check a protocol and everything it refers to, without running it."""
    from labcrane.registry import discover
    from labcrane.study import load

    study = load(protocol, discover())
    sessions = len(study.protocol.sessions)
    out.print(
        f"{protocol}: study {study.protocol.study!r} is fine: {sessions} "
        f"session{'s' if sessions > 1 else ''} on the {study.machine.title}",
        markup=False,
    )


def plan(
    protocol: ProtocolPath,
    participants: Annotated[
        int | None, typer.Option(help="how many to list; as many as are planned by default", min=1)
    ] = None,
    participant: Annotated[
        str | None, typer.Option(help="one participant only, by pseudonym")
    ] = None,
    export: Annotated[
        Path | None, typer.Option(help="write the whole allocation into this CSV file as well")
    ] = None,
) -> None:
    """Show blocks, each participant's order, and how long a session is likely to take."""
    from labcrane.allocation import allocate, as_csv, balance
    from labcrane.durable_file import SHARED_FILE, write_text
    from labcrane.plan import plan_session
    from labcrane.pseudonyms import pseudonyms
    from labcrane.registry import discover
    from labcrane.study import load

    study = load(protocol, discover())
    count = participants or study.protocol.participants.planned
    names = [participant] if participant else pseudonyms(study.protocol.participants.pattern, count)
    for number, session in enumerate(study.protocol.sessions, start=1):
        table = whole_table("participant", "slot", "seed", "block", "trials", "order", "minutes")
        for name in names:
            session_plan = plan_session(study, name, number)
            for block in session_plan.blocks:
                counted = sum(trial.planned.counted for trial in block.trials)
                table.add_row(
                    name,
                    f"{session_plan.slot}{f' {block.group}' if block.group else ''}",
                    str(session_plan.seed),
                    f"{block.number} {block.name}{' (practice)' if block.practice else ''}",
                    str(counted),
                    "; ".join(
                        f"{factor}: {', '.join(levels)}" for factor, levels in block.levels.items()
                    ),
                    f"{block.expected_s / 60:.1f}",
                )
        whole = plan_session(study, names[0], number).expected_s / 60
        out.print(f"session {number} {session.name!r}: about {whole:.0f} minutes")
        out.print(table)
    allotments = allocate(study, dict.fromkeys(names))
    if not participant:
        for line in balance(study, allotments):
            out.print(line, markup=False)
    if export:
        write_text(export, as_csv(allotments), SHARED_FILE)
        out.print(f"allocation: {export}", markup=False)


def plugins() -> None:
    """List what installed plugins offer."""
    from labcrane.registry import ROLES, discover

    registry = discover()
    table = Table("role", "name", "plugin", "settings")
    for role, entry in ROLES.items():
        for name, offer in sorted(registry.offers[role].items()):
            settings = ", ".join(offer.settings.model_fields)
            table.add_row(entry.word, name, registry.plugins[role][name], settings)
    out.print(table)
    for plugin, why in registry.broken.items():
        out.print(f"plugin {plugin!r} is broken: {why}", markup=False, style="red")
