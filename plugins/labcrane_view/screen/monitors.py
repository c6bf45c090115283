"""Monitors that there are, and where the desktop puts them."""

import re
import subprocess
from dataclasses import dataclass

from labcrane import DeviceError

LINE = re.compile(r"^ *\d+: \+?\*?(\S+) (\d+)/(\d+)x(\d+)/\d+\+(-?\d+)\+(-?\d+)", re.MULTILINE)

CURRENT = re.compile(r"([\d.]+)[ +]*\*")
"""The rate of the mode that a monitor is in."""


@dataclass(frozen=True, slots=True)
class Monitor:
    """One monitor: its name, its size and place on the desktop in pixels, and its width in mm.

    The width is 0 where the monitor does not say it.
    """

    name: str
    size: tuple[int, int]
    origin: tuple[int, int]
    wide_mm: int = 0


def monitors() -> list[Monitor]:
    """Return the monitors as xrandr lists them, in its order.

    Raises
    ------
    DeviceError
        There is no xrandr, or it finds no display.
    """
    return parse(_said("--listactivemonitors"))


def refresh_rates() -> list[tuple[str, float]]:
    """Return each monitor that is on and its refresh rate in Hz, 0 for a virtual screen.

    Raises
    ------
    DeviceError
        There is no xrandr, or it finds no display.
    """
    return parse_rates(_said("--current"))


def _said(option: str) -> str:
    try:
        done = subprocess.run(  # noqa: S603 - the option is ours
            ["xrandr", option],  # noqa: S607 - wherever it is installed
            capture_output=True,
            encoding="utf-8",
            check=True,
        )
    except FileNotFoundError:
        raise DeviceError(
            "screen needs xrandr to find monitors, which is not installed; install it (Debian: "
            "x11-xserver-utils) or leave screen out"
        ) from None
    except subprocess.CalledProcessError as error:
        raise DeviceError(
            f"xrandr lists no monitors: {error.stderr.strip()}; check that DISPLAY names the "
            "running display, or leave screen out"
        ) from None
    return done.stdout


def parse(text: str) -> list[Monitor]:
    """Return the monitors in what xrandr prints."""
    found = []
    for name, *numbers in LINE.findall(text):
        width, wide_mm, height, left, top = map(int, numbers)
        found.append(Monitor(name, (width, height), (left, top), wide_mm))
    return found


def parse_rates(text: str) -> list[tuple[str, float]]:
    """Return the monitors with their rates in what xrandr prints."""
    found, name = [], ""
    for line in text.splitlines():
        if " connected" in line:
            name = line.split()[0]
        elif current := CURRENT.search(line):
            found.append((name, float(current[1])))
    return found
