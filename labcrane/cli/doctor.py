"""The command that looks at the computer before a study day."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.text import Text

from labcrane.cli.inspect import out
from labcrane.cli.network import Local, stay_on_this_computer
from labcrane.cli.sync import STYLES

if TYPE_CHECKING:
    from labcrane.doctor.diagnosis import Check
    from labcrane.study import Study


def doctor(
    protocol: Annotated[
        Path | None, typer.Option(help="look at what this study needs, and at nothing else")
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="data folder; data/ beside the protocol by default")
    ] = None,
    peer: Annotated[
        list[str] | None, typer.Option(help="computer that sends a stream; may be given again")
    ] = None,
    move: Annotated[
        bool, typer.Option("--move", help="you are there to move the controls as you are told")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON, for scripts")] = False,
    local: Local = False,
) -> None:
    """Check the computer before a study day: every line says how it is and what to do."""
    if local:
        stay_on_this_computer()
    from labcrane.doctor import disk
    from labcrane.doctor.diagnosis import diagnosis, keep
    from labcrane.doctor.examination import examine, left_out
    from labcrane.finding import Verdict
    from labcrane.registry import discover
    from labcrane.study import load

    registry = discover()
    study = load(protocol, registry) if protocol else None
    folder = data or (protocol.parent if protocol else Path()) / "data"
    needed = _session_bytes(study) if study else disk.NEEDED_BYTES
    checks = []
    for check in examine(folder, registry, study, needed_bytes=needed, peers=peer or (), move=move):
        checks.append(check)
        if not as_json:
            _print(check)
    found = diagnosis(checks, left_out(registry, study))
    if as_json:
        print(json.dumps(found.as_data(), indent=1, ensure_ascii=False))
    else:
        for line in found.left_out:
            out.print(f"not looked at: {line}", markup=False, style="dim")
    if study:
        kept = keep(found, folder)
        Console(stderr=True, soft_wrap=True).print(
            f"kept in {kept}: sessions within a day have it in their record", markup=False
        )
    if found.verdict is Verdict.FAIL:
        raise typer.Exit(1)


def _print(check: "Check") -> None:
    found = check.finding
    line = Text(f"{found.verdict.value} ", style=STYLES[found.verdict.value])
    out.print(line.append(f"{check.area}: {found.text}", style="default"))
    if found.advice:
        out.print(Text(f"     {found.advice}"))


def _session_bytes(study: "Study") -> float:
    """Return what the longest session takes, with the same margin as ``labcrane run`` asks for."""
    from labcrane import rig
    from labcrane.frame_log import frame_bytes
    from labcrane.plan import plan_session
    from labcrane.pseudonyms import pseudonyms
    from labcrane.session import RESERVE_S

    (name,) = pseudonyms(study.protocol.participants.pattern, 1)
    run = rig.describe(rig.build(study, simulated=True), study, 0)
    longest = max(
        plan_session(study, name, number).expected_s
        for number in range(1, len(study.protocol.sessions) + 1)
    )
    return (2.0 * longest + RESERVE_S) * frame_bytes(run) * run.rate_hz
