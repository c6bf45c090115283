"""Arguments and options that several commands take."""

from pathlib import Path
from typing import Annotated

import typer

AsJson = Annotated[bool, typer.Option("--json", help="for programs")]
ProtocolPath = Annotated[Path, typer.Argument(metavar="PROTOCOL", help="the study's YAML file")]
DataBeside = Annotated[
    Path | None, typer.Option(help="data folder; data/ beside the protocol by default")
]


def data_folder(data: Path | None, protocol: Path | None) -> Path:
    """Return the data folder that was given, or the one beside the protocol; here without any."""
    return data or (protocol.parent if protocol else Path()) / "data"


Local = Annotated[bool, typer.Option("--local", help="keep LSL streams on this computer")]


def stay_on_this_computer() -> None:
    """Keep LSL on loopback; before anything imports pylsl."""
    from labcrane.streams.network import use_loopback

    use_loopback()
