"""The command that looks at the computer before a study day."""

import json
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.cli.commands.delay import measure_audio, measure_display
from labcrane.cli.options import (
    DataBeside,
    Local,
    data_folder,
    protocol_in,
    stay_on_this_computer,
)
from labcrane.cli.output import out
from labcrane.cli.sync import STYLES
from labcrane.errors import ProtocolError

if TYPE_CHECKING:
    from labcrane.doctor.report import Check
    from labcrane.protocol.study import Study


def doctor(
    protocol: Annotated[
        Path | None,
        typer.Option(
            help="look at what this study needs, and at nothing else", callback=protocol_in
        ),
    ] = None,
    data: DataBeside = None,
    peer: Annotated[
        list[str] | None, typer.Option(help="computer that sends a stream; may be given again")
    ] = None,
    move: Annotated[
        bool, typer.Option("--move", help="you are there to move the controls as you are told")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON, for scripts")] = False,
    display: Annotated[
        bool, typer.Option("--display", help="measure a view's delay with a photodiode instead")
    ] = False,
    audio: Annotated[
        bool, typer.Option("--audio", help="measure a sound's delay with a microphone instead")
    ] = False,
    stream: Annotated[
        str | None, typer.Option(help="LSL stream of the sensor; without it nothing is measured")
    ] = None,
    channel: Annotated[int, typer.Option(help="which channel of it", min=1)] = 1,
    name: Annotated[
        str | None, typer.Option(help="which view or sound; the only one by default")
    ] = None,
    count: Annotated[int, typer.Option(help="how many changes are presented", min=2)] = 100,
    local: Local = False,
) -> None:
    """Check the computer before a study day: every line says how it is and what to do."""
    if local:
        stay_on_this_computer()
    if display or audio:
        if protocol is None:
            raise ProtocolError("say whose views and sounds to measure: --protocol protocol.yaml")
        for wanted, measure in ((display, measure_display), (audio, measure_audio)):
            if wanted:
                measure(protocol, stream, name, count, channel)
    else:
        _examine(protocol, data, peer or (), move=move, as_json=as_json)


def _examine(
    protocol: Path | None, data: Path | None, peers: Sequence[str], *, move: bool, as_json: bool
) -> None:
    from labcrane.core.findings import Verdict
    from labcrane.doctor import disk
    from labcrane.doctor.checks import examine, keep_apart, left_out
    from labcrane.doctor.report import diagnosis
    from labcrane.protocol.study import load
    from labcrane.registry.registry import discover

    registry = discover(study=protocol)
    study = load(protocol, registry) if protocol else None
    folder = data_folder(data, protocol)
    needed = _session_bytes(study) if study else disk.NEEDED_BYTES
    checks: list[Check] = []
    looked = examine(folder, registry, study, needed_bytes=needed, peers=peers, move=move)
    for check in chain(looked, _rates(study, checks)):
        checks.append(check)
        if not as_json:
            _print(check)
    found = diagnosis(checks, left_out(registry, study))
    if as_json:
        print(json.dumps(found.as_data(), indent=1, ensure_ascii=False))
    else:
        for line in found.left_out:
            out.print(f"not looked at: {line}", markup=False, style="dim")
    kept = None
    if study:
        from rich.console import Console

        kept = keep_apart(found, folder)
        said = (
            kept.text if kept.verdict is Verdict.PASS else f"not kept: {kept.text}; {kept.advice}"
        )
        Console(stderr=True, soft_wrap=True).print(said, markup=False)
    if found.verdict is Verdict.FAIL or (kept and kept.verdict is Verdict.FAIL):
        raise typer.Exit(1)


def _rates(study: "Study | None", before: Sequence["Check"]) -> Iterator["Check"]:
    """Yield how many pictures a second the operator's views show, of those that can be opened."""
    from labcrane.core.findings import Verdict
    from labcrane.doctor import apart
    from labcrane.doctor.report import Check
    from labcrane.feedback.picture_rate import WAIT_S, rate_examinations

    if study is None:
        return
    for name, examination in rate_examinations(study).items():
        area = f"view {name}"
        if any(each.area == area and each.finding.verdict is Verdict.FAIL for each in before):
            continue  # it cannot be opened, which is said
        for finding in apart.examine(examination, wait_s=WAIT_S):
            yield Check(area, finding)


def _print(check: "Check") -> None:
    from rich.text import Text

    found = check.finding
    line = Text(f"{found.verdict.value} ", style=STYLES[found.verdict.value])
    out.print(line.append(f"{check.area}: {found.text}", style="default"))
    if found.advice:
        out.print(Text(f"     {found.advice}"))


def _session_bytes(study: "Study") -> float:
    """Return what the longest session takes, with the same margin as ``labcrane run`` asks for."""
    from labcrane.design.plan import plan_session
    from labcrane.files.pseudonyms import pseudonyms
    from labcrane.protocol.rig import Rig
    from labcrane.recording.data_folder import needed_bytes
    from labcrane.recording.frame_log import frame_bytes
    from labcrane.session.session import RESERVE_S

    (name,) = pseudonyms(study.protocol.participants.pattern, 1)
    run = Rig.build(study, simulated=True).describe(study, 0)
    longest = max(
        plan_session(study, name, number).expected_s
        for number in range(1, len(study.protocol.sessions) + 1)
    )
    return needed_bytes(longest, frame_bytes(run) * run.rate_hz, RESERVE_S)
