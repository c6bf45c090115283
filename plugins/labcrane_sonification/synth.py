"""Synthesizer of a tone with pyo, to a sound device or block by block into an array."""

import ctypes
import io
import os
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from typing import Any

import numpy as np
import numpy.typing as npt

from labcrane import DeviceError
from labcrane_sonification.settings import FULL_SCALE, SonificationSettings
from labcrane_sonification.tone import Tone, gains

os.environ.setdefault("PYO_GUI_WX", "0")  # pyo looks for a GUI when it is imported
os.environ.setdefault("JACK_NO_START_SERVER", "1")  # or it starts a JACK server of its own
with redirect_stdout(io.StringIO()):  # where there is no GUI it advertises one, on every start
    import pyo

CHANNELS = 2


def server(settings: SonificationSettings) -> Any:
    """Return a sound server that plays, or raise :class:`DeviceError`."""
    made = silent_server(settings)
    made.start()
    return made


def silent_server(settings: SonificationSettings) -> Any:
    """Return a sound server that has opened its device and plays nothing yet.

    Raises
    ------
    DeviceError
        There is no such device, or it does not take the rate and the block.
    """
    made = _server(settings, settings.driver)
    # pyo 1.1.0 does not refuse a missing device: it ends the process with a segmentation fault
    # (belangeo/pyo #15, #121).
    if settings.driver == "portaudio":
        _check_portaudio(settings.device)
        if settings.device is not None:
            made.setOutputDevice(settings.device)
    made.boot()
    if not made.getIsBooted():
        hint = "start a JACK server first" if settings.driver == "jack" else "another may hold it"
        raise DeviceError(
            f"the {settings.driver} sound system does not take {settings.rate_hz} Hz in blocks of "
            f"{settings.block} samples; {hint}"
        )
    if (rate := int(made.getSamplingRate())) != settings.rate_hz:
        raise DeviceError(
            f"rate_hz is {settings.rate_hz}, but the {settings.driver} sound system runs at "
            f"{rate}; write that, or start the system at the other rate"
        )
    return made


def offline_server(settings: SonificationSettings) -> Any:
    """Return a sound server that makes a block when it is asked to."""
    made = _server(settings, "manual")
    made.boot()
    made.start()
    return made


def _server(settings: SonificationSettings, audio: str) -> Any:
    made = pyo.Server(
        sr=settings.rate_hz,
        nchnls=CHANNELS,
        buffersize=settings.block,
        duplex=0,
        audio=audio,
        jackname="labcrane",
    )
    made.setVerbosity(1)
    made.deactivateMidi()
    return made


def _check_portaudio(device: int | None) -> None:
    names, numbers = pyo.pa_get_output_devices()
    if pyo.pa_get_default_output() < 0 or not numbers:
        raise DeviceError(
            "there is no sound output device; connect one, use driver: jack, or write "
            "on_fault: {feedback_lost: continue} to continue without sound"
        )
    if device is not None and device not in numbers:
        known = ", ".join(f"{n} {name}" for n, name in zip(numbers, names, strict=True))
        raise DeviceError(f"there is no sound output device {device}; there is {known}")


class Synth:
    """The tone's partials on a server.

    Every control is ramped, so a change never clicks; it begins with the next block.
    """

    def __init__(self, sound_server: Any, settings: SonificationSettings) -> None:
        ramp = settings.ramp_s
        count = 1 + max(settings.overtones)
        self.server = sound_server
        start = float(settings.pitch_hz[0])
        self._pitch = pyo.SigTo(start, time=ramp, init=start)
        self._levels = [pyo.SigTo(0.0, time=ramp, init=0.0) for _ in range(count)]
        self._sides = [pyo.SigTo(float(gain), time=ramp, init=float(gain)) for gain in gains(0.0)]
        # pyo objects without a reference fall silent.
        self._partials = [
            pyo.Sine(freq=self._pitch * (n + 1), mul=level) for n, level in enumerate(self._levels)
        ]
        mixed = pyo.Mix(self._partials, voices=1)
        self._sum = pyo.Clip(mixed, min=-FULL_SCALE, max=FULL_SCALE)  # of what was once recorded
        self._out = [(self._sum * side).out(channel) for channel, side in enumerate(self._sides)]

    def sound(self, wanted: Tone) -> None:
        """Sound like ``wanted`` from the next block on."""
        if wanted.level > 0.0:  # a tone that fades keeps its pitch
            self._set(self._pitch, wanted.pitch)
        for number, level in enumerate(self._levels, start=1):
            heard = number <= 1 + wanted.overtones
            self._set(level, wanted.level / number if heard else 0.0)
        for side, gain in zip(self._sides, gains(wanted.pan), strict=True):
            self._set(side, gain)

    def at_every_block(self, begun: Callable[[float], None]) -> None:
        """Call ``begun`` with the time, in seconds, whenever the server begins a block."""
        self.server.setCallback(lambda: begun(time.perf_counter()))

    def ramp(self, seconds: float) -> None:
        """Let every change from now on take so long."""
        for control in (self._pitch, *self._levels, *self._sides):
            control.setTime(seconds)

    def silence(self) -> None:
        """Fade out."""
        for level in self._levels:
            self._set(level, 0.0)

    @staticmethod
    def _set(control: Any, value: float) -> None:
        if control.value != value:  # setting takes ten times as long as looking
            control.value = float(value)

    def close(self) -> None:
        """Stop the server."""
        self.server.stop()
        self.server.shutdown()

    def block(self) -> npt.NDArray[np.float32]:
        """Make the next block of an offline server, shape ``(block, 2)``."""
        self.server.process()
        return self._view().copy()

    def _view(self) -> npt.NDArray[np.float32]:
        address = self.server.getOutputAddr()
        place = int(address, 16) if isinstance(address, str) else int(address)
        size = int(self.server.getBufferSize()) * CHANNELS
        pointer = ctypes.cast(place, ctypes.POINTER(ctypes.c_float))
        return np.ctypeslib.as_array(pointer, (size,)).reshape(-1, CHANNELS)
