"""The command ``labcrane gateway can``: from a panel's bus to the open gateway protocol."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

out = Console(soft_wrap=True, highlight=False)


def can(
    bus: Annotated[str, typer.Option(help="interface:channel, as slcan:/dev/ttyUSB0")],
    valve: Annotated[
        list[str] | None,
        typer.Option(
            help="joint=number, or joint=Message.Signal with --map, or its value and both sides, "
            "joint=Message.Value,Message.Positive,Message.Negative; once per joint"
        ),
    ] = None,
    map_: Annotated[
        Path | None,
        typer.Option(
            "--map",
            help="DBC file of a panel without valve commands; its signals' names are the joints'",
        ),
    ] = None,
    neutral: Annotated[
        float, typer.Option(help="value of a DBC signal at rest, where the valve is shut")
    ] = 0.0,
    full: Annotated[float, typer.Option(help="value of a DBC signal at full flow")] = 100.0,
    bitrate: Annotated[int, typer.Option(help="bits per second")] = 250_000,
    name: Annotated[str, typer.Option(help="name of the command stream")] = "gateway.command",
    seconds: Annotated[float | None, typer.Option(help="stop after this time")] = None,
) -> None:
    """Bridge a control panel on a CAN bus to the open gateway protocol (docs/gateway.md)."""
    from pydantic import ValidationError

    from labcrane_can.bridge import Bridge
    from labcrane_can.settings import CanSettings

    valves = _valves(valve or [], map_)
    try:
        settings = CanSettings(
            bus=bus, bitrate=bitrate, valves=valves, map=map_, neutral=neutral, full=full
        )
    except ValidationError as error:
        raise typer.BadParameter(_said(error.errors()[0])) from None
    out.print(f"{bus} -> LSL stream {name!r}: {', '.join(valves)}; Ctrl-C ends", markup=False)
    with Bridge(settings, name) as bridge:
        bridge.run(seconds, lambda text: out.print(text, markup=False))


def _said(error: "ErrorDetails") -> str:
    """Return in words what is wrong with an option."""
    where = ".".join(map(str, error["loc"]))
    text = error["msg"].removeprefix("Value error, ")
    return f"{where}: {text}" if where else text


def _valves(written: list[str], map_: Path | None) -> dict[str, int | str | dict[str, str]]:
    """Return the valves as written; of a DBC file alone, every signal by its own name."""
    pairs = dict(each.split("=", 1) for each in written if "=" in each)
    if len(pairs) < len(written):
        raise typer.BadParameter("write joint=number: --valve boom=3", param_hint="--valve")
    if pairs:
        return {joint: _valve(what) for joint, what in pairs.items()}
    if map_ is None:
        raise typer.BadParameter(
            "say which valve moves which joint, as in --valve boom=3, or give a DBC file with "
            "--map whose signals have the joints' names",
            param_hint="--valve",
        )
    from labcrane_can.dbc import signal_names

    return dict(signal_names(map_))


def _valve(written: str) -> int | str | dict[str, str]:
    parts = written.split(",")
    if len(parts) > 1:
        return dict(zip(("value", "positive", "negative"), parts, strict=False))
    return int(written) if written.isdigit() else written
