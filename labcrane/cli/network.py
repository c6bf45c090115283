"""Where LSL reaches, for commands that say so."""

from typing import Annotated

import typer

Local = Annotated[bool, typer.Option("--local", help="keep LSL streams on this computer")]


def stay_on_this_computer() -> None:
    """Keep LSL on loopback; before anything imports pylsl."""
    from labcrane.streams.network import use_loopback

    use_loopback()
