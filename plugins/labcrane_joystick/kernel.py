"""Kernel's treatment of an axis before SDL sees it (Linux)."""

import os
import struct
import sys
from pathlib import Path

from labcrane.core import Value
from labcrane_joystick.settings import AXES

NOT_READ = "not read"

EV_ABS = 0x03
HATS = range(0x10, 0x18)
ABSINFO = struct.Struct("@6i")
"""``struct input_absinfo``: value, minimum, maximum, fuzz, flat, resolution."""
BITS = 8
"""Bytes of the bit field of absolute axes."""


def smoothing(node: Path | None) -> list[tuple[Value, Value]]:
    """Return fuzz and flat of each axis in ``AXES``, in raw units of the device.

    The kernel holds back or averages changes about as small as ``fuzz``, by default 1/256 of
    the range; a udev rule can set it to 0. ``flat`` is its dead zone, which SDL ignores.
    """
    found: list[tuple[Value, Value]] = []
    if sys.platform == "linux" and node is not None:
        import fcntl  # noqa: PLC0415 - not on Windows

        try:
            device = os.open(node, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            return [(f"{NOT_READ}: {error}",) * 2] * len(AXES)
        try:
            bits = fcntl.ioctl(device, read_request(0x20 + EV_ABS, BITS), bytes(BITS))
            for code in axis_codes(bits)[: len(AXES)]:
                request = read_request(0x40 + code, ABSINFO.size)
                found.append(fuzz_and_flat(fcntl.ioctl(device, request, bytes(24))))
        finally:
            os.close(device)
    return [*found, *[(NOT_READ, NOT_READ)] * (len(AXES) - len(found))]


def read_request(number: int, size: int) -> int:
    """Return the ioctl that reads ``size`` bytes from an event device: ``_IOR('E', ...)``."""
    return 2 << 30 | size << 16 | ord("E") << 8 | number


def axis_codes(bits: bytes) -> list[int]:
    """Return the kernel's codes of SDL's axes, in SDL's order: ascending, hats left out."""
    field = int.from_bytes(bits, sys.byteorder)
    return [code for code in range(8 * BITS) if field >> code & 1 and code not in HATS]


def fuzz_and_flat(absinfo: bytes) -> tuple[int, int]:
    """Return the two out of a ``struct input_absinfo``."""
    _, _, _, fuzz, flat, _ = ABSINFO.unpack(absinfo)
    return fuzz, flat
