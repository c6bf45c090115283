"""Whether the sound device is there, and takes the rate and the block that are asked for."""

from labcrane import Ask, DeviceError, Finding, Verdict
from labcrane_sonification.settings import SonificationSettings
from labcrane_sonification.synth import server

LONG_S = 0.02
"""Length of a block beyond which the delay of a sound is noticed."""


def examine(settings: SonificationSettings, ask: Ask | None) -> list[Finding]:
    """Open the sound system as a session would, play nothing, and close it."""
    del ask  # nothing needs to be moved
    try:
        made = server(settings)
    except DeviceError as error:
        said, _, fix = str(error).partition("; ")
        return [Finding(Verdict.FAIL, said, fix)]
    block, rate = int(made.getBufferSize()), float(made.getSamplingRate())
    made.stop()
    made.shutdown()
    text = (
        f"{_name(settings)} takes {rate:.0f} Hz in blocks of {block} samples: "
        f"{1e3 * block / rate:.1f} ms each"
    )
    if block / rate > LONG_S:
        return [Finding(Verdict.WARN, text, "set block: 256 or less, or use driver: jack")]
    return [Finding(Verdict.PASS, text)]


def _name(settings: SonificationSettings) -> str:
    if settings.driver == "jack":
        return "the JACK server"
    import pyo  # noqa: PLC0415 - once synth has told it what not to do

    names, numbers = pyo.pa_get_output_devices()
    wanted = pyo.pa_get_default_output() if settings.device is None else settings.device
    found = dict(zip(numbers, names, strict=True))
    return f"sound device {wanted} ({found[wanted]})"
