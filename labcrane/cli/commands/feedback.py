"""Commands for views and sounds."""

import os
import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Annotated

import typer

from labcrane.cli.options import ProtocolHere, stay_on_this_computer, study_of
from labcrane.cli.output import out

FILES = Path("preview")


def preview(
    protocol: ProtocolHere,
    folder: Annotated[
        Path | None,
        typer.Option(
            "--out", "--to", help="write PNG and WAV files to this folder instead of showing them"
        ),
    ] = None,
    recording: Annotated[
        Path | None,
        typer.Option(help="participant file with the movement; by default a simulated one"),
    ] = None,
    session: Annotated[int, typer.Option(help="session of the recording")] = 1,
    trial: Annotated[
        int | None, typer.Option(help="trial; by default the first counted one")
    ] = None,
) -> None:
    """Play a movement in the study's windows and sounds; as files where there is no display."""
    stay_on_this_computer()
    from labcrane.feedback.player import play
    from labcrane.feedback.preview import chosen, write_preview

    study = study_of(protocol)
    shows = sys.platform != "linux" or bool(os.environ.get("DISPLAY"))
    if folder is None and shows:
        frames, scene = chosen(study, recording, session, trial)
        play(study, frames, scene, lambda text: out.print(text, markup=False))
        return
    if folder is None:
        out.print(f"there is no display (DISPLAY is not set); files go to {FILES}/", markup=False)
    target = folder or FILES
    with _place(target, recording) as place:
        written = write_preview(
            study, place, recording, session, trial, lambda text: out.print(text, markup=False)
        )
    for path in written:
        out.print(str(target / path.relative_to(place)), markup=False)


def _place(target: Path, recording: Path | None) -> AbstractContextManager[Path]:
    """Return where to write; the register lists files that show a participant's movement."""
    if recording is None:
        return nullcontext(target)
    from labcrane.participants.products import files_about

    return files_about(recording, "feedback preview", target)
