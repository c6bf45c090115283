"""Shows frames of different colours, and prints how far behind the X server's picture is."""

import ctypes
import sys

import numpy as np

from labcrane.core import Sphere
from labcrane.testing import TARGETS, ch8, make_run, make_target
from labcrane_view.settings import ViewSettings
from labcrane_view.view import View

run = make_run(ch8(), task=TARGETS)
camera = {"eye": (0, 0, 0), "look": (5, 0, 0)}
settings = ViewSettings(
    size=(200, 120), camera=camera, content="feedback", hud=(), targets=False, shadow=0
)
view = View(settings, ch8())
view.open(run)

X = ctypes.CDLL("libX11.so.6")
X.XOpenDisplay.restype = X.XGetImage.restype = ctypes.c_void_p
X.XDefaultRootWindow.restype = X.XGetPixel.restype = ctypes.c_ulong
X.XDestroyImage.argtypes = [ctypes.c_void_p]
X.XDefaultRootWindow.argtypes = [ctypes.c_void_p]
X.XGetImage.argtypes = [ctypes.c_void_p, ctypes.c_ulong, *[ctypes.c_int] * 2]
X.XGetImage.argtypes += [ctypes.c_uint, ctypes.c_uint, ctypes.c_ulong, ctypes.c_int]
X.XGetPixel.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int]
display = X.XOpenDisplay(None)
root = X.XDefaultRootWindow(display)


def on_screen() -> int:
    """Return the blue of the middle of the window, wherever it stands: the brightest there is."""
    image = X.XGetImage(display, root, 0, 0, 1000, 700, 0xFFFFFFFF, 2)
    places = [(x, y) for x in range(0, 1000, 40) for y in range(0, 700, 40)]
    blue = max(X.XGetPixel(image, x, y) & 255 for x, y in places)
    X.XDestroyImage(image)
    return blue


def show(number: int) -> None:
    frame = make_target(run, number)
    colour = (0.0, 0.0, number / 40, 1.0)
    frame.shapes = (Sphere("wall", (5.0, 0.0, 0.0), 3.0, colour),)
    view.present(frame)


levels = []
for number in range(1, 41):  # what each colour looks like, shown until it must be there
    for _ in range(3):
        show(number)
    levels.append(on_screen())
assert (np.diff(levels) > 0).all(), levels
for number in range(5, 35):
    show(number)
    seen = int(np.argmin(np.abs(np.array(levels) - on_screen()))) + 1
    sys.stdout.write(f"{number - seen}\n")
view.close()
