"""Windows of an X display, found by their titles through Xlib."""

import ctypes
import ctypes.util
from collections.abc import Iterator
from typing import Any

from labcrane import DeviceError


def window_of(display: str, title: str) -> int:
    """Return the number of the window of a title.

    Raises
    ------
    DeviceError
        There is none, or no X display.
    """
    library = ctypes.util.find_library("X11")
    x = ctypes.CDLL(library) if library else None
    if x is not None:
        x.XOpenDisplay.restype = ctypes.c_void_p
        x.XDefaultRootWindow.restype = ctypes.c_ulong
    opened = None if x is None else ctypes.c_void_p(x.XOpenDisplay(display.encode()))
    if x is None or not opened:
        raise DeviceError(
            f"display {display!r} cannot be opened by Xlib; check display, and DISPLAY"
        )
    try:
        for window, name in _titles(x, opened, x.XDefaultRootWindow(opened)):
            if name == title:
                return window
    finally:
        x.XCloseDisplay(opened)
    raise DeviceError(f"display {display!r} has no window {title!r}; open the view there first")


def _titles(x: Any, display: Any, window: int) -> Iterator[tuple[int, str]]:
    """Yield each window inside a window, with its title."""
    name = ctypes.c_char_p()
    if x.XFetchName(display, ctypes.c_ulong(window), ctypes.byref(name)):
        yield window, (name.value or b"").decode(errors="replace")
        x.XFree(name)
    root, parent = ctypes.c_ulong(), ctypes.c_ulong()
    inside, count = ctypes.POINTER(ctypes.c_ulong)(), ctypes.c_uint()
    x.XQueryTree(
        display, ctypes.c_ulong(window), ctypes.byref(root), ctypes.byref(parent),
        ctypes.byref(inside), ctypes.byref(count),
    )  # fmt: skip
    found = inside[: count.value]
    if found:
        x.XFree(inside)
    for each in found:
        yield from _titles(x, display, each)
