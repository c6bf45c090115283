"""Identify and calibrate the sticks: ``python -m labcrane_joystick``."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import date
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError

from labcrane import DeviceError
from labcrane_joystick import sdl
from labcrane_joystick.calibration import default_path, save
from labcrane_joystick.procedure import Look, Say, calibrate
from labcrane_joystick.settings import AXES, JoystickSettings
from labcrane_joystick.stick import attached, pair

BETWEEN_LOOKS_S = 0.005


def set_up(settings: JoystickSettings, path: Path, say: Say, look: Look) -> None:
    """List the sticks, guide a person through the procedure, and store the result in ``path``.

    SDL must have been started. ``look`` is called before each reading of the sticks.
    """
    sticks = attached()
    for stick in sticks:
        say(f"attached: {stick} at {stick.port}")
    if not all(stick.has_socket for stick in sticks):
        say(
            "this computer does not name the sockets of its joysticks, so only their order tells "
            "left from right: repeat this whenever you plug one in again"
        )
    found = calibrate(pair(sticks, settings.stick), say, look, date.today().isoformat())
    save(path, settings.stick, found)
    for side, calibration in (("left", found.left), ("right", found.right)):
        say(f"{side} joystick, at {calibration.port}")
        for name, axis in zip(AXES, calibration.axes, strict=True):
            say(f"  {name}: {axis.minimum} to {axis.maximum}, at rest {axis.centre}")
    say(f"stored in {path}")


def wait_and_look() -> None:
    """Wait a little, and process the sticks' events; an unplugged stick raises DeviceError."""
    import pygame  # noqa: PLC0415 - heavy

    time.sleep(BETWEEN_LOOKS_S)
    if pygame.event.get(pygame.JOYDEVICEREMOVED):
        raise DeviceError("a joystick was unplugged; plug it in and start again")


def main(
    stick: Annotated[
        str, typer.Option(help="USB vendor and product of both sticks")
    ] = JoystickSettings().stick,
) -> None:
    """Find out which stick is the left one, and where its axes rest and end."""
    try:
        settings = JoystickSettings(stick=stick)
    except ValidationError:
        raise typer.BadParameter(
            f"{stick!r} is not a model; write vendor:product, four hexadecimal digits each, "
            f"like {JoystickSettings().stick}"
        ) from None
    try:
        with _sdl():
            set_up(settings, default_path(), typer.echo, wait_and_look)
    except DeviceError as error:
        typer.echo(error, err=True)
        raise typer.Exit(1) from None


@contextmanager
def _sdl() -> Iterator[None]:
    sdl.start()
    try:
        yield
    finally:
        sdl.stop()


if __name__ == "__main__":
    typer.run(main)
