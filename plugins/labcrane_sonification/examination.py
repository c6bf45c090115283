"""Sound examination: whether the device is there and takes the rate and block asked for."""

import sys

from labcrane import DeviceError
from labcrane.core import Finding, Verdict
from labcrane.registry import Prompt
from labcrane_sonification import real_time
from labcrane_sonification.settings import SonificationSettings
from labcrane_sonification.synth import server, silent_server

LONG_S = 0.02
"""Length of a block beyond which the delay of a sound is noticed."""


def examine(settings: SonificationSettings, ask: Prompt | None) -> list[Finding]:
    """Open the sound system as a session would, play nothing, and close it.

    A sound device is not started: pyo 1.0.6 stops one while it holds Python's global lock, for
    which the device's thread may be waiting, and both then wait for ever.
    """
    del ask  # nothing needs to be moved
    started = settings.driver == "jack" and sys.platform == "linux"  # its thread is looked at
    try:
        made = server(settings) if started else silent_server(settings)
    except DeviceError as error:
        return [Finding.failed(error)]
    block, rate = int(made.getBufferSize()), float(made.getSamplingRate())
    found = _scheduling() if started else []
    if started:
        made.stop()
    made.shutdown()
    text = (
        f"{_name(settings)} takes {rate:.0f} Hz in blocks of {block} samples: "
        f"{1e3 * block / rate:.1f} ms each"
    )
    if block / rate > LONG_S:
        return [Finding(Verdict.WARN, text, "set block: 256 or less, or use driver: jack"), *found]
    return [Finding(Verdict.PASS, text), *found]


def _scheduling() -> list[Finding]:
    """Return whether an open JACK server has given its thread in this process a priority."""
    if real_time.others_are_real_time():
        return [Finding(Verdict.PASS, "the JACK server runs in real time")]
    fix = "start it as jackd --realtime, by a user who is allowed real-time priorities"
    text = "the JACK server does not run in real time: it misses blocks on a busy computer"
    return [Finding(Verdict.WARN, text, fix)]


def _name(settings: SonificationSettings) -> str:
    if settings.driver == "jack":
        return "the JACK server"
    import pyo  # noqa: PLC0415 - once synth has told it what not to do

    names, numbers = pyo.pa_get_output_devices()
    wanted = pyo.pa_get_default_output() if settings.device is None else settings.device
    found = dict(zip(numbers, names, strict=True))
    return f"sound device {wanted} ({found[wanted]})"
