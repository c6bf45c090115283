"""Commands for views and sounds."""

from pathlib import Path
from typing import Annotated

import typer

from labcrane.cli.inspect import ProtocolPath
from labcrane.cli.output import out


def preview(
    protocol: ProtocolPath,
    folder: Annotated[Path, typer.Option("--to", help="folder for the files")] = Path("preview"),
    recording: Annotated[
        Path | None,
        typer.Option(help="participant file with the movement; a simulated one by default"),
    ] = None,
    session: Annotated[int, typer.Option(help="session of the recording")] = 1,
    trial: Annotated[int | None, typer.Option(help="which trial; the first counted one")] = None,
) -> None:
    """Write what a movement looks and sounds like: PNG for every view, WAV for every sound."""
    from labcrane.feedback_preview import write_preview
    from labcrane.registry import discover
    from labcrane.study import load

    study = load(protocol, discover(study=protocol))
    for path in write_preview(study, folder, recording, session, trial):
        out.print(str(path), markup=False)
