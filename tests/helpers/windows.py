"""Views without a screen and on an X server of the test's own, and where things are in them."""

import gc
import math
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from needs import GRAPHICS, need

from labcrane import Frame, Run
from labcrane.machines import link_boxes
from labcrane.testing import TARGETS, ch8, crane_at, make_run, make_target
from labcrane_view.settings import CameraSettings, ViewSettings
from labcrane_view.view import View

SIZE = (640, 360)
POSE = (0.35, -0.2, 0.35, 0.75)
MACHINE = ch8()


def a_scene() -> Run:
    return replace(make_run(MACHINE, task=TARGETS), bodies=link_boxes(MACHINE))


def make_frame(number: int = 0) -> Frame:
    frame = make_target(a_scene(), number)
    frame.state = crane_at(MACHINE, POSE)
    frame.task = np.array([4.5, 0.2, 0.8, 0.25, 6.5, 2.4, 0.8])
    return frame


@contextmanager
def a_view(**settings: object) -> Iterator[View]:
    need(*GRAPHICS)
    view = View(ViewSettings(**{"display": "hidden", "size": SIZE, "hud": ()} | settings), MACHINE)
    try:
        view.open(a_scene())
        yield view
    finally:
        view.close()


def shown(frame: Frame, **settings: object) -> np.ndarray:
    with a_view(**settings) as view:
        view.present(frame)
        view.present(frame)  # the first picture is drawn while shadow and textures are made
        return view.picture().astype(int)


def projected(
    point: tuple[float, float, float], camera: CameraSettings, size: tuple[int, int] = SIZE
) -> tuple[float, float]:
    """Return where a pinhole camera sees a point, from angles alone."""
    offset = np.subtract(point, camera.eye)
    ahead = np.subtract(camera.look, camera.eye)
    heading = math.atan2(ahead[1], ahead[0])
    pitch = math.atan2(ahead[2], math.hypot(ahead[0], ahead[1]))
    along = offset[0] * math.cos(heading) + offset[1] * math.sin(heading)
    right = offset[0] * math.sin(heading) - offset[1] * math.cos(heading)
    depth = along * math.cos(pitch) + offset[2] * math.sin(pitch)
    up = -along * math.sin(pitch) + offset[2] * math.cos(pitch)
    focal = size[0] / 2 / math.tan(math.radians(camera.fov_deg / 2))
    return size[0] / 2 + focal * right / depth, size[1] / 2 - focal * up / depth


def centre_of(mask: np.ndarray) -> tuple[float, float]:
    """Return the middle of the pixels in a mask, in pixels from the upper left corner."""
    assert mask.any(), "nothing of that colour is in the picture"
    rows, columns = np.nonzero(mask)
    return (columns.min() + columns.max() + 1) / 2, (rows.min() + rows.max() + 1) / 2


def magenta(picture: np.ndarray) -> np.ndarray:
    red, green, blue = np.moveaxis(picture, -1, 0)
    return (red > 120) & (blue > 120) & (green < 90)


@contextmanager
def an_x_server(*more: str) -> Iterator[str]:
    """Start an X server, and give its display; the server itself chooses the number."""
    need("Xvfb")
    read, write = os.pipe()
    arguments = [
        "Xvfb",
        "-displayfd",
        str(write),
        "-screen",
        "0",
        "1000x700x24",
        "-nolisten",
        "tcp",
        "-noreset",  # or it refuses new clients for a moment when the last one has gone
        *more,
    ]
    server = subprocess.Popen(arguments, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read, encoding="utf-8") as numbers:
        number = numbers.readline().strip()
    try:
        yield f":{number}"
    finally:
        # A window's destructor uses its connection, and Xlib ends the process where the server of
        # one has gone: whatever nobody refers to any more goes first.
        gc.collect()
        server.terminate()
        server.wait()
