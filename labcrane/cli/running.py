"""Commands that run a session: demo and run."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.cli.inspect import ProtocolPath, out
from labcrane.errors import ProtocolError

if TYPE_CHECKING:
    from labcrane.session import Visit

DEMO = "demo.yaml"


def run(
    protocol: ProtocolPath,
    participant: Annotated[str, typer.Option(help="pseudonym: P001")],
    session: Annotated[int, typer.Option(help="which of the protocol's sessions")] = 1,
    data: Annotated[
        Path | None, typer.Option(help="data folder; data/ beside the protocol by default")
    ] = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="a simulated operator takes the controls")
    ] = False,
    fast: Annotated[
        bool, typer.Option("--fast", help="with --simulate: as fast as the machine can")
    ] = False,
    pilot: Annotated[
        bool, typer.Option("--pilot", help="a trial run: its files are stamped PILOT")
    ] = False,
    local: Annotated[
        bool, typer.Option("--local", help="keep LSL streams on this computer")
    ] = False,
) -> None:
    """Run a session of a study."""
    if fast and not simulate:
        raise ProtocolError("--fast needs --simulate: people cannot be hurried")
    if local or simulate:
        _stay_on_this_computer()
    from labcrane.registry import discover
    from labcrane.session import Visit
    from labcrane.study import load

    visit = Visit(
        load(protocol, discover()),
        participant,
        session,
        data or protocol.parent / "data",
        simulated=simulate,
        fast=fast,
        pilot=pilot,
    )
    out.print(f"participant file: {_lead(visit)}", markup=False)


def demo(
    data: Annotated[Path, typer.Option(help="where the recording goes")] = Path("labcrane-demo"),
) -> None:
    """Run a shortened aiming study with a simulated operator."""
    _stay_on_this_computer()
    from importlib.resources import files

    from labcrane.movement_picture import draw
    from labcrane.recording.recording import open_recording
    from labcrane.registry import discover
    from labcrane.session import Visit
    from labcrane.study import load

    study = load(Path(str(files("labcrane") / DEMO)), discover())
    visit = Visit(study, "P001", 1, data, simulated=True, fast=True)
    number = 1
    while visit.folder.path.exists():  # a demo can be run again; nothing is overwritten
        number += 1
        visit = replace(visit, participant=f"P{number:03}")
    path = _lead(visit)
    picture = path.with_suffix(".png")
    draw(open_recording(path).session(1), picture)
    out.print(f"participant file: {path}", markup=False)
    out.print(f"the movements:    {picture}", markup=False)


def _lead(visit: "Visit") -> Path:
    from labcrane.cli.terminal import Terminal
    from labcrane.console import QueueConsole
    from labcrane.plan import plan_session
    from labcrane.session import run as run_session

    blocks = plan_session(visit.study, visit.participant, visit.session).blocks
    total = sum(
        trial.planned.counted for block in blocks if not block.practice for trial in block.trials
    )
    console = QueueConsole()
    with Terminal(console, out, total, keys=not visit.simulated):
        return run_session(visit, console)


def _stay_on_this_computer() -> None:
    from labcrane.streams.network import use_loopback

    use_loopback()
