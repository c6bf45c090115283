"""Gaze markers: squares in a picture's corners by which a head-mounted eye tracker finds it.

A head-mounted tracker measures where the wearer looks in the picture of its own camera. It finds
the screen in that picture by AprilTags, printed or shown, whose corners give its position.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from panda3d import core

from labcrane_view.screen.placement import Piece
from labcrane_view.settings import GAZE_MARKER_CELLS, GazeMarkerSettings, PatchSettings

FAMILY = "tag36h11"
"""What trackers' programs call these squares."""

CODES = (
    0xD7E00984B, 0xDDA664CA7, 0xDC4A1C821, 0xE17B470E9,
    0xEF91D01B1, 0xF429CDD73, 0x05DA29225, 0x1106CBA43,
    0x223BED79D, 0x21F51213C, 0x33EB19CA6, 0x3F76EB0F8,
    0x469A97414, 0x45DCFE0B0, 0x4A6465F72, 0x51801DB96,
)  # fmt: skip
"""The first of the 587 codes of the family: 36 bits, any two at least 11 bits apart in every turn
(Wang, J. and Olson, E.: AprilTag 2: Efficient and robust fiducial detection, IROS 2016)."""

BITS = 36
CORNERS = 4

FIRST_BITS = ((1, 1), (2, 1), (3, 1), (4, 1), (5, 1), (2, 2), (3, 2), (4, 2), (3, 3))
"""Column and row, within the black frame, of the first quarter of the bits. The other quarters are
the same turned by right angles, so that a square seen from the side has its code turned as well."""

ORDER = 60
"""Drawn last, so that the markers stay visible when the picture is dimmed in a pause."""


@dataclass(frozen=True, slots=True)
class GazeMarker:
    """One square, and where it is.

    Attributes
    ----------
    code
        Its number within the family.
    left, top, size
        Of the square with its white margin, in pixels from the window's upper left corner.
    """

    code: int
    left: int
    top: int
    size: int

    @property
    def frame(self) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of its black frame, in pixels: what a tracker measures."""
        cell = self.size // GAZE_MARKER_CELLS
        right, bottom = self.left + self.size - cell, self.top + self.size - cell
        return self.left + cell, self.top + cell, right, bottom

    def flipped(self, flip: str, window: tuple[int, int]) -> "GazeMarker":
        """Return where it is in a window of so many pixels that shows its picture turned over."""
        width, height = window
        if flip == "horizontal":
            return replace(self, left=width - self.left - self.size)
        return replace(self, top=height - self.top - self.size) if flip == "vertical" else self


def placed(
    settings: GazeMarkerSettings,
    pieces: Sequence[Piece],
    height: int,
    patch: PatchSettings | None = None,
) -> list[GazeMarker]:
    """Return the markers in the corners of each monitor's part, numbered clockwise from upper left.

    Parameters
    ----------
    height
        Of the window, in pixels.
    patch
        The photodiode's square: a marker that would lie on it lies beside it.
    """
    across = max(piece.left + piece.width for piece in pieces)
    found = []
    code = settings.first
    for piece in pieces:
        right = piece.left + piece.width - settings.size
        bottom = piece.top + piece.height - settings.size
        corners = (
            (piece.left, piece.top), (right, piece.top), (right, bottom), (piece.left, bottom)
        )  # fmt: skip
        for left, top in corners:
            aside = _aside(left, top, settings.size, (across, height), patch)
            found.append(GazeMarker(code, left + aside, top, settings.size))
            code += 1
    return found


def _aside(
    left: int, top: int, size: int, window: tuple[int, int], patch: PatchSettings | None
) -> int:
    """Return by how much a marker moves to the right so that it does not lie on the patch."""
    if patch is None:
        return 0
    below = top + size > window[1] - patch.size
    if not (below if patch.corner.startswith("bottom") else top < patch.size):
        return 0
    if patch.corner.endswith("left"):
        return max(0, patch.size - left)
    return min(0, window[0] - patch.size - (left + size))


def pattern(code: int) -> list[list[bool]]:
    """Return a marker's cells from the top, white or not: margin, black frame, 6 by 6 bits."""
    turned = list(FIRST_BITS)
    for _ in range(CORNERS - 1):
        turned += [(7 - row, column) for column, row in turned[-len(FIRST_BITS) :]]
    cells = [
        [not (0 < row < GAZE_MARKER_CELLS - 1 and 0 < column < GAZE_MARKER_CELLS - 1)
         for column in range(GAZE_MARKER_CELLS)]
        for row in range(GAZE_MARKER_CELLS)
    ]  # fmt: skip
    for bit, (column, row) in enumerate(turned):
        cells[row + 1][column + 1] = bool(CODES[code] >> (BITS - 1 - bit) & 1)
    return cells


def _strips(cells: list[list[bool]]) -> Iterator[tuple[int, int, int]]:
    """Yield row, first column and end of each run of black cells."""
    for row, line in enumerate(cells):
        column = 0
        while column < len(line):
            end = column
            while end < len(line) and not line[end]:
                end += 1
            if end > column:
                yield row, column, end
            column = end + 1


def drawn(marker: GazeMarker, height: int) -> Any:
    """Return a node of a marker in an overlay, whose y goes up from the window's lower edge."""
    cell = marker.size // GAZE_MARKER_CELLS
    top = height - marker.top
    root = core.NodePath(f"gaze marker {marker.code}")
    box = (marker.left, marker.left + marker.size, top - marker.size, top)
    _card(root, box, white=True, order=ORDER)
    for row, column, end in _strips(pattern(marker.code)):
        left, upper = marker.left + column * cell, top - row * cell
        box = (left, marker.left + end * cell, upper - cell, upper)
        _card(root, box, white=False, order=ORDER + 1)
    return root


def _card(root: Any, box: tuple[int, int, int, int], *, white: bool, order: int) -> None:
    maker = core.CardMaker("cells")
    maker.set_frame(*box)
    card = root.attach_new_node(maker.generate())
    card.set_color(*(3 * (float(white),)), 1.0)
    card.set_bin("fixed", order)


def described(markers: Sequence[GazeMarker]) -> str:
    """Return the markers for the record: number, and left top right bottom of each frame."""
    corners = "; ".join(
        f"{marker.code} at {' '.join(str(edge) for edge in marker.frame)}" for marker in markers
    )
    return f"{FAMILY}, black frames in px: {corners}"
