"""Display examination: whether there is one, the monitor asked for, and a renderer."""

import re
import subprocess

from labcrane import DeviceError
from labcrane.core import Finding, Verdict
from labcrane.registry import Prompt
from labcrane_view.settings import ViewSettings
from labcrane_view.window import open_window

CURRENT = re.compile(r"([\d.]+)[ +]*\*")
SLOW_HZ = 50.0


def examine(settings: ViewSettings, ask: Prompt | None) -> list[Finding]:
    """Open the window for a moment and list the monitors with their refresh rates."""
    del ask  # nothing needs to be moved
    try:
        window = open_window(settings, "labcrane doctor")
    except DeviceError as error:
        return [Finding.failed(error)]
    size = window.output.size
    text = f"{window.driver} draws a window of {size[0]} x {size[1]} pixels"
    window.close()
    found = [Finding(Verdict.PASS, text)]
    if window.software:
        fix = "install the driver of the graphics card; software drawing is slow"
        found = [Finding(Verdict.WARN, text, fix)]
    return found if settings.display == "hidden" else [*found, *monitors()]


def monitors() -> list[Finding]:
    """Return the monitors that are on and their refresh rates, as xrandr says."""
    try:
        done = subprocess.run(
            ["xrandr"],  # noqa: S607 - wherever it is installed
            capture_output=True,
            encoding="utf-8",
            check=True,
        )
    except (FileNotFoundError, subprocess.CalledProcessError):
        fix = "install xrandr (Debian: x11-xserver-utils)"
        return [Finding(Verdict.WARN, "the monitors' refresh rates are not known", fix)]
    return [_rate(name, rate) for name, rate in refresh_rates(done.stdout)]


def refresh_rates(text: str) -> list[tuple[str, float]]:
    """Return each monitor and its refresh rate in Hz, from what xrandr prints."""
    found, name = [], ""
    for line in text.splitlines():
        if " connected" in line:
            name = line.split()[0]
        elif current := CURRENT.search(line):
            found.append((name, float(current[1])))
    return found


def _rate(name: str, rate_hz: float) -> Finding:
    if rate_hz <= 0.0:  # a virtual screen has none
        return Finding(Verdict.PASS, f"monitor {name} has no refresh rate of its own")
    text = f"monitor {name} shows {rate_hz:g} pictures a second"
    if rate_hz >= SLOW_HZ:
        return Finding(Verdict.PASS, text)
    return Finding(Verdict.WARN, text, "choose a faster mode, or another cable: xrandr lists them")
