"""Arguments and options that several commands take."""

from pathlib import Path
from typing import Annotated

import typer

AsJson = Annotated[bool, typer.Option("--json", help="print JSON, for scripts")]
PROTOCOL_FILE = "protocol.yaml"


def protocol_in(path: Path | None) -> Path | None:
    """Return a study's file where its folder was given."""
    if path is None:
        return None
    inside = path / PROTOCOL_FILE
    return inside if inside.is_file() else path


ProtocolPath = Annotated[
    Path,
    typer.Argument(
        metavar="PROTOCOL",
        help=f"the study's YAML file, or a folder with {PROTOCOL_FILE}",
        callback=protocol_in,
    ),
]
DataBeside = Annotated[
    Path | None, typer.Option(help="data folder; by default data/ in the protocol's folder")
]


def data_folder(data: Path | None, protocol: Path | None) -> Path:
    """Return the given data folder, or the one in the protocol's folder, or data/ here."""
    return data or (protocol.parent if protocol else Path()) / "data"


Local = Annotated[bool, typer.Option("--local", help="keep LSL streams on this computer")]


def stay_on_this_computer() -> None:
    """Keep LSL on loopback; before anything imports pylsl."""
    from labcrane.streams.network import use_loopback

    use_loopback()
