"""Display examination: whether there is one, the monitor asked for, and a renderer."""

from labcrane import DeviceError
from labcrane.core import Finding, Verdict
from labcrane.registry import Prompt
from labcrane_view.screen.monitors import refresh_rates
from labcrane_view.screen.refresh import Refresh, refresh_of
from labcrane_view.screen.window import open_window
from labcrane_view.settings import ViewSettings

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
    refresh = refresh_of(settings, window)
    window.close()
    found = [Finding(Verdict.PASS, text)]
    if window.software:
        fix = "install the driver of the graphics card; software drawing is slow"
        found = [Finding(Verdict.WARN, text, fix)]
    return found if settings.display == "hidden" else [*found, _swap(refresh), *_monitors()]


def _monitors() -> list[Finding]:
    """Return the findings about each monitor's refresh rate."""
    try:
        rates = refresh_rates()
    except DeviceError:
        fix = "install xrandr (Debian: x11-xserver-utils)"
        return [Finding(Verdict.WARN, "the monitors' refresh rates are not known", fix)]
    return [_rate(name, rate) for name, rate in rates]


def _swap(refresh: Refresh) -> Finding:
    """Return the finding about the display of pictures: buffers and tearing."""
    text = f"tearing is {refresh.tearing}"
    if refresh.buffers > 1 and refresh.waits is not False:
        return Finding(Verdict.PASS, text)
    fix = "switch on vertical synchronisation in the graphics driver, or a compositor that has it"
    return Finding(Verdict.WARN, text, fix)


def _rate(name: str, rate_hz: float) -> Finding:
    if rate_hz <= 0.0:  # a virtual screen has none
        return Finding(Verdict.PASS, f"monitor {name} has no refresh rate of its own")
    text = f"monitor {name} shows {rate_hz:g} pictures a second"
    if rate_hz >= SLOW_HZ:
        return Finding(Verdict.PASS, text)
    return Finding(Verdict.WARN, text, "choose a faster mode, or another cable: xrandr lists them")
