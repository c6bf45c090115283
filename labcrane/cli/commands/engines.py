"""Command that compares engines on a study's own movements."""

from pathlib import Path
from typing import Annotated

import typer

from labcrane.cli.options import ProtocolPath, stay_on_this_computer
from labcrane.cli.output import out


def compare_engines(
    protocol: ProtocolPath,
    engines: Annotated[
        str, typer.Option(help="engines to compare, separated by commas")
    ] = "bullet_crane,mujoco_crane",
    participant: Annotated[
        str, typer.Option(help="pseudonym of the simulated participant")
    ] = "P001",
    session: Annotated[int, typer.Option(help="which of the protocol's sessions")] = 1,
    folder: Annotated[Path, typer.Option("--out", help="path of the page")] = Path(
        "labcrane-engines"
    ),
) -> None:
    """Run one session's input on several engines and report how far they diverge."""
    stay_on_this_computer()
    from labcrane.files import atomic
    from labcrane.replay.engines import as_html, as_markdown
    from labcrane.replay.engines import compare_engines as compare

    names = [name.strip() for name in engines.split(",") if name.strip()]
    done = compare(protocol, names, participant=participant, session=session)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in (("engines.md", as_markdown(done)), ("engines.html", as_html(done))):
        atomic.write_text(folder / name, text)
        out.print(f"comparison: {folder / name}", markup=False)
