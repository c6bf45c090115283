"""Places of windows on the desktop: on monitors, next to each other, and back after a loss."""

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from panda3d import core

from labcrane import DeviceError
from labcrane_view.screen.monitors import Monitor, monitors
from labcrane_view.settings import ViewSettings

Pixels = tuple[int, int]
Place = tuple[Pixels, Pixels]
"""Upper left corner and size, in pixels."""

LEAST = (160, 90)
"""Width and height, in pixels, below which a window is too small to see anything."""

LOOK_S = 1.0
"""Between two looks at which monitors there are, in seconds."""

TRIES = 30
"""Pictures for which a window is asked to move: Panda3D drops a request that it takes for done
while the X server's answer to the last one is under way, and a window manager may refuse it."""

MM_PER_M = 1000.0


@dataclass(frozen=True, slots=True)
class Piece:
    """One monitor's part of a window and of the wide picture that is shown in it.

    Attributes
    ----------
    left, top, width, height
        In the window, in pixels from its upper left corner.
    x, y
        Where its upper left corner is in the wide picture, in pixels.
    """

    left: int
    top: int
    width: int
    height: int
    x: int
    y: int


@dataclass(frozen=True, slots=True)
class PictureSpan:
    """A window and the parts of one picture in it; the gaps between monitors hide some parts.

    Attributes
    ----------
    place
        Place of the window on the desktop.
    picture
        Width and height of the whole picture with its hidden parts, in pixels.
    pieces
        The part of it on each monitor.
    """

    place: Place
    picture: Pixels
    pieces: tuple[Piece, ...]


def whole(place: Place) -> PictureSpan:
    """Return a window that shows its picture in one piece."""
    return PictureSpan(place, place[1], (Piece(0, 0, *place[1], 0, 0),))


def span(found: Sequence[Monitor], gap_px: int) -> PictureSpan:
    """Return the window over monitors from left to right, with ``gap_px`` hidden between them.

    Raises
    ------
    DeviceError
        They do not stand side by side, in this order.
    """
    for one, other in pairwise(found):
        if other.origin[0] < one.origin[0] + one.size[0]:
            raise DeviceError(
                f"screen {other.name} is not to the right of {one.name} on the desktop; name "
                "screens: from left to right, and place them so with xrandr"
            )
    left, top = found[0].origin[0], min(each.origin[1] for each in found)
    bottom = max(each.origin[1] + each.size[1] for each in found)
    size = (found[-1].origin[0] + found[-1].size[0] - left, bottom - top)
    pieces, x = [], 0
    for each in found:
        down = each.origin[1] - top
        pieces.append(Piece(each.origin[0] - left, down, *each.size, x, down))
        x += each.size[0] + gap_px
    return PictureSpan(((left, top), size), (x - gap_px, size[1]), tuple(pieces))


def placed(settings: ViewSettings, before: Sequence[ViewSettings], desktop: Pixels) -> PictureSpan:
    """Return the place of a view's window: on its monitors, or next to the earlier windows.

    Raises
    ------
    DeviceError
        A monitor is missing, or there is no room.
    """
    if settings.display == "hidden":
        return whole(((0, 0), settings.size))
    if wanted := settings.all_screens:
        found = [_monitor(each) for each in wanted]
        if len(found) == 1:
            return whole((found[0].origin, found[0].size))
        return span(found, round(settings.bezel_mm / MM_PER_M * per_metre(settings, found[0])))
    taken = _taken(before, desktop)
    place = free_place(settings.size, taken, desktop)
    if place is None:
        raise DeviceError(
            f"there is no room for a window of {settings.size[0]}x{settings.size[1]} on the "
            f"desktop of {desktop[0]}x{desktop[1]} beside the {len(taken)} before it; give the "
            "views screens of their own (screen:), or smaller windows (size:)"
        )
    return whole(place)


def per_metre(settings: ViewSettings, monitor: Monitor | None) -> float:
    """Return the screen's pixels per metre, from ``screen_mm`` or as the monitor reports.

    Raises
    ------
    DeviceError
        Nobody says how large it is.
    """
    if settings.screen_mm is not None:
        across = settings.size[0] if monitor is None else monitor.size[0]
        return across / settings.screen_mm * MM_PER_M
    if monitor is None or monitor.wide_mm <= 0:
        who = "a picture without a screen" if monitor is None else f"monitor {monitor.name}"
        raise DeviceError(
            f"{who} does not report its width; measure the visible picture and write screen_mm"
        )
    return monitor.size[0] / monitor.wide_mm * MM_PER_M


def monitor_of(settings: ViewSettings) -> Monitor | None:
    """Return the monitor that a view's picture is on; None for a picture without a screen.

    A window without a screen of its own is on the first one.
    """
    if settings.display == "hidden":
        return None
    if settings.all_screens:
        return _monitor(settings.all_screens[0])
    found = monitors()
    return found[0] if found else None


def free_place(size: Pixels, taken: Sequence[Place], desktop: Pixels) -> Place | None:
    """Return where a window covers none of those that are there, and how large it is there.

    The upper left corner, right of one, or below one. Where there is no room for the whole window
    it is smaller, of the same shape; None where hardly anything is left of it.
    """
    places = [_fitted(corner, size, taken, desktop) for corner in _corners(taken)]
    best = max(places, key=lambda place: place[1][0] * place[1][1])
    asked = min(1.0, size[0] / LEAST[0], size[1] / LEAST[1])
    if best[1][0] < asked * LEAST[0] or best[1][1] < asked * LEAST[1]:
        return None
    return best


def _corners(taken: Sequence[Place]) -> list[Pixels]:
    """Return upper left corners at which a window could lie, edge to edge with others."""
    across = [0, *(left + width for (left, _), (width, _) in taken)]
    down = [0, *(top + height for (_, top), (_, height) in taken)]
    rights = [(left + width, top) for (left, top), (width, _) in taken]
    belows = [(left, top + height) for (left, top), (_, height) in taken]
    return [(0, 0), *rights, *belows, *((x, y) for x in across for y in down)]


def _fitted(corner: Pixels, size: Pixels, taken: Sequence[Place], desktop: Pixels) -> Place:
    """Return the largest window of a shape at a corner, no larger than ``size``."""
    share = min(1.0, *((desktop[axis] - corner[axis]) / size[axis] for axis in (0, 1)))
    for (left, top), (width, height) in taken:
        if corner[0] >= left + width or corner[1] >= top + height:
            continue
        # It ends left of the other or above it, whichever leaves more.
        share = min(share, max((left - corner[0]) / size[0], (top - corner[1]) / size[1]))
    share = max(share, 0.0)
    return corner, (int(share * size[0]), int(share * size[1]))


def _taken(before: Sequence[ViewSettings], desktop: Pixels) -> list[Place]:
    """Return the places of windows, in the order in which they were given them."""
    known = monitors() if any(view.all_screens for view in before) else []
    places: list[Place] = []
    for view in before:
        if view.display == "hidden":
            continue
        if not view.all_screens:
            place = free_place(view.size, places, desktop)
            places += [] if place is None else [place]
        # A view on a monitor that is not there has no window, which it says itself.
        on = [_find(known, wanted) for wanted in view.all_screens]
        places += [(monitor.origin, monitor.size) for monitor in on if monitor is not None]
    return places


def _monitor(wanted: int | str) -> Monitor:
    found = monitors()
    if (monitor := _find(found, wanted)) is not None:
        return monitor
    known = ", ".join(f"{n} ({m.name}, {m.size[0]}x{m.size[1]})" for n, m in enumerate(found))
    raise DeviceError(f"there is no screen {wanted}; there is {known}")


def _find(found: Sequence[Monitor], wanted: int | str) -> Monitor | None:
    named = (m for number, m in enumerate(found) if wanted in (number, m.name))
    return next(named, None)


class WindowPlacer:
    """Move a window to a remaining monitor when its own is lost, and back when it returns.

    A separate thread queries the desktop, which does not delay the picture. A window without a
    ``screen`` stays where it is.

    Attributes
    ----------
    lost
        Number of its monitors that are missing.
    """

    def __init__(self, settings: ViewSettings, place: Place) -> None:
        self._place = place
        self._names: tuple[str, ...] = ()
        if settings.all_screens and settings.display != "hidden":
            self._names = tuple(_monitor(wanted).name for wanted in settings.all_screens)
        self._seen: list[Monitor] = []
        self._stop = threading.Event()
        self._corner, self._tries = place[0], 0
        self.lost = 0
        self._failure: Exception | None = None
        if self._names:
            threading.Thread(target=self._watch, name="monitors", daemon=True).start()

    def keep(self, output: Any) -> None:
        """Move the window if monitors were lost or connected since the last call.

        Raises
        ------
        DeviceError
            The desktop's monitors can no longer be queried.
        """
        if self._failure is not None:
            raise DeviceError(
                f"the monitors can no longer be watched: {self._failure!r}; the view "
                "restarts and looks for them again"
            ) from self._failure
        there = self._seen
        if not there:
            return
        lost = sum(name not in {each.name for each in there} for name in self._names)
        if lost != self.lost:
            self.lost = lost
            left = [each for each in there if each.name in self._names] or there
            self._corner = left[0].origin if lost else self._place[0]
            self._tries = TRIES
        if self._tries and tuple(output.get_properties().get_origin()) != self._corner:
            self._tries -= 1
            output.request_properties(core.WindowProperties(origin=core.LPoint2i(*self._corner)))

    def look(self) -> None:
        """Ask the desktop which monitors there are."""
        try:
            self._seen = monitors()
        except DeviceError:
            return  # the server is changing them, or gone: the next query shows which

    def close(self) -> None:
        """Watch no more."""
        self._stop.set()

    def _watch(self) -> None:
        try:
            while not self._stop.wait(LOOK_S):
                self.look()
        except Exception as error:  # noqa: BLE001 - raised where the picture is made
            self._failure = error
