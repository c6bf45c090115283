"""my_part: commands of the command line."""

from pathlib import Path
from typing import Annotated

import typer

from labcrane import hookimpl
from labcrane.registry import CommandOffer

labcrane_api = 1


def count(data: Annotated[Path, typer.Argument(help="a study's data folder")]) -> None:
    """Count the trials of every participant."""
    # What takes long to import is imported here, so that labcrane --help stays instant.
    from labcrane import open_recording

    for path in sorted(data.glob("*/*.h5")):
        recording = open_recording(path)
        trials = sum(len(recording.session(number).trials) for number in recording.sessions)
        typer.echo(f"{path.stem}: {trials}")


@hookimpl
def labcrane_commands() -> list[CommandOffer]:
    return [CommandOffer(("my_part", "count"), count)]
