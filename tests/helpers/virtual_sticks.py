"""Joysticks without hardware: SDL's own virtual devices, in the very libSDL2 that pygame uses.

What is plugged in here goes the whole way of a real one through SDL and pygame: device events,
opening, axis values, removal. Only the kernel is left out.
"""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from needs import SKIP_NOTHING

from labcrane import DeviceError
from labcrane.core import Layout
from labcrane.testing import ch8, make_frame, make_run, opened
from labcrane_joystick import sdl
from labcrane_joystick.calibration import Calibration, Calibrations
from labcrane_joystick.dual_joystick import DualJoystick
from labcrane_joystick.settings import JoystickSettings

MODEL = "044f:b10a"
COLUMNS = Layout("the joysticks", DualJoystick.signals).columns

SDL_INIT_JOYSTICK = 0x200
FLIGHT_STICK = 4
DESCRIPTION_VERSION = 1
THRUSTMASTER = (0x044F, 0xB10A)


RUMBLE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_uint16, ctypes.c_uint16)


class Description(ctypes.Structure):
    """``SDL_VirtualJoystickDesc``, version 1, of SDL 2.24 and newer."""

    _fields_ = (
        ("version", ctypes.c_uint16),
        ("type", ctypes.c_uint16),
        ("axes", ctypes.c_uint16),
        ("buttons", ctypes.c_uint16),
        ("hats", ctypes.c_uint16),
        ("vendor", ctypes.c_uint16),
        ("product", ctypes.c_uint16),
        ("padding", ctypes.c_uint16),
        ("button_mask", ctypes.c_uint32),
        ("axis_mask", ctypes.c_uint32),
        ("name", ctypes.c_char_p),
        ("user_data", ctypes.c_void_p),
        ("update", ctypes.c_void_p),
        ("set_player_index", ctypes.c_void_p),
        ("rumble", RUMBLE),
        ("others", ctypes.c_void_p * 3),
    )


class VirtualStick:
    """A stick that is plugged in: a Thrustmaster T.16000M unless said otherwise.

    Attributes
    ----------
    rumbled
        What its motors were told, the heavy and the light one, 0 to 65535.
    """

    def __init__(
        self,
        library: ctypes.CDLL,
        name: str = "Thrustmaster T.16000M",
        model: tuple[int, int] = THRUSTMASTER,
        axes: int = 4,
        buttons: int = 16,
        *,
        motors: bool = False,
    ) -> None:
        self.rumbled: list[tuple[int, int]] = []
        self._rumble = RUMBLE(lambda _, low, high: self.rumbled.append((low, high)) or 0)
        self._library = library
        self._name = name.encode()  # SDL borrows it
        self._description = Description(
            version=DESCRIPTION_VERSION,
            type=FLIGHT_STICK,
            axes=axes,
            buttons=buttons,
            hats=1,
            vendor=model[0],
            product=model[1],
            name=self._name,
            rumble=self._rumble if motors else RUMBLE(),
        )
        index = library.SDL_JoystickAttachVirtualEx(ctypes.byref(self._description))
        self._check(index >= 0)
        self.instance: int = library.SDL_JoystickGetDeviceInstanceID(index)
        self._handle = library.SDL_JoystickOpen(index)
        self._check(bool(self._handle))

    def move(self, axis: int, raw: int) -> None:
        """Move an axis, counted from 0, to a raw number of 16 bits."""
        self._check(self._library.SDL_JoystickSetVirtualAxis(self._handle, axis, raw) == 0)

    def press(self, *, down: bool, button: int = 0) -> None:
        """Press or release a button; the trigger unless said otherwise."""
        self._check(self._library.SDL_JoystickSetVirtualButton(self._handle, button, down) == 0)

    def unplug(self) -> None:
        """Pull the plug."""
        # A device index moves when another stick goes; the instance is for ever.
        for index in range(self._library.SDL_NumJoysticks()):
            if self._library.SDL_JoystickGetDeviceInstanceID(index) == self.instance:
                self._check(self._library.SDL_JoystickDetachVirtual(index) == 0)
                self._library.SDL_JoystickClose(self._handle)
                return
        raise LookupError(f"stick {self.instance} is not plugged in")

    def _check(self, fine: bool) -> None:  # noqa: FBT001 - reads as an assertion
        if not fine:
            raise OSError(self._library.SDL_GetError().decode())


class Desk:
    """Where sticks are plugged in."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library
        self._plugged: list[VirtualStick] = []

    def plug(self, **what: object) -> VirtualStick:
        """Plug in another stick; ``what`` is passed to :class:`VirtualStick`."""
        stick = VirtualStick(self._library, **what)  # type: ignore[arg-type]
        self._plugged.append(stick)
        return stick

    def clear(self) -> None:
        """Unplug what is still plugged in."""
        for stick in self._plugged:
            with suppress(LookupError):
                stick.unplug()


@contextmanager
def desk() -> Iterator[Desk]:
    """Yield a desk on which nothing is plugged in, and leave SDL as if it had never run."""
    sdl.start()
    try:
        library = _mapped_sdl()
    except BaseException:  # pytest's skip and fail are none of Exception
        sdl.stop()
        raise
    # pygame's own reference goes when a device under test is closed; the sticks outlive that.
    library.SDL_InitSubSystem(SDL_INIT_JOYSTICK)
    table = Desk(library)
    try:
        yield table
    finally:
        table.clear()
        sdl.stop()
        while library.SDL_WasInit(SDL_INIT_JOYSTICK):
            library.SDL_QuitSubSystem(SDL_INIT_JOYSTICK)


def _mapped_sdl() -> ctypes.CDLL:
    """Return the libSDL2 this process already has: a second copy would know no sticks of ours."""
    maps = Path("/proc/self/maps")
    lines = maps.read_text(encoding="utf-8").splitlines() if maps.exists() else []
    paths = {line.split(maxsplit=5)[-1] for line in lines}
    found = [path for path in paths if Path(path).name.startswith("libSDL2-2")]
    if not found:
        message = "no libSDL2 of pygame is mapped, so there are no virtual sticks to test with"
        if os.environ.get(SKIP_NOTHING):
            pytest.fail(message)
        pytest.skip(message)
    library = ctypes.CDLL(found[0])
    library.SDL_GetError.restype = ctypes.c_char_p
    library.SDL_JoystickOpen.restype = ctypes.c_void_p
    library.SDL_JoystickClose.argtypes = [ctypes.c_void_p]
    library.SDL_JoystickSetVirtualAxis.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int16]
    library.SDL_JoystickSetVirtualButton.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint8]
    return library


def read(device: DualJoystick) -> dict[str, float]:
    run = make_run(ch8(), axes=device.signals)
    frame = make_frame(run)
    return dict(zip(COLUMNS, device.read(frame.tick, frame).tolist(), strict=True))


def open_fails(**settings: str) -> str:
    device = DualJoystick(JoystickSettings(**settings))
    with pytest.raises(DeviceError) as refused, opened(device, make_run(ch8())):
        pass
    return str(refused.value)


def both(left: Calibration, right: Calibration) -> Calibrations:
    return Calibrations(date="2025-01-31", left=left, right=right)
