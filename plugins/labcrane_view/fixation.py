"""Fixation target: a point that the operator looks at, by which an eye tracker's drift is known.

A disc with a cross in it and a dot in the middle: of the shapes compared, gaze is steadiest on it
(Thaler, L. et al.: What is the best fixation target? Vision Research 76, 2013).
"""

import math
from typing import Any

from panda3d import core

DISC_DEG, DOT_DEG = 0.6, 0.2
"""Diameters of disc and dot at the eye, in degrees, and the dot's is the cross's width too, as in
that paper."""

DISC = 0.02
"""Diameter of the disc as a proportion of the picture's height, if the viewing distance is
unknown."""

GREY = (0.5, 0.5, 0.5, 1.0)
"""Colour of the background: pupils are as wide as with the mean brightness of other pictures."""

BLACK, LIGHT = (0.0, 0.0, 0.0, 1.0), GREY

SIDES = 64
"""Number of sides of the polygon that approximates a circle."""

ORDER = 45
"""Over the text and the state's curtain, below markers and the photodiode's patch."""


class FixationTarget:
    """What is to be looked at, on a plain ground that covers the picture.

    Parameters
    ----------
    root
        Of an overlay in pixels, y up.
    size
        Width and height of the window, in pixels.
    disc_px
        Diameter of the disc, in pixels.
    """

    def __init__(self, root: Any, size: tuple[int, int], disc_px: float) -> None:
        self._size = size
        self._root = root.attach_new_node("fixation")
        maker = core.CardMaker("ground")
        maker.set_frame(0, size[0], 0, size[1])
        _place(self._root.attach_new_node(maker.generate()), GREY, 0)
        self._target = self._root.attach_new_node("target")
        radius, half = disc_px / 2.0, disc_px / 2.0 * DOT_DEG / DISC_DEG
        _place(self._target.attach_new_node(_disc(radius)), BLACK, 1)
        for wide, high in ((radius, half), (half, radius)):
            maker.set_frame(-wide, wide, -high, high)
            _place(self._target.attach_new_node(maker.generate()), LIGHT, 2)
        _place(self._target.attach_new_node(_disc(half)), BLACK, 3)
        self._root.hide()

    def show(self, point: tuple[float, ...]) -> None:
        """Show the target at a share of width and height from the upper left; hide it for none."""
        if not point:
            self._root.hide()
            return
        x, y = point
        self._target.set_pos(x * self._size[0], 0.0, (1.0 - y) * self._size[1])
        self._root.show()


def disc_px(height: int, viewing_m: float | None, px_per_m: float | None) -> float:
    """Return the disc's diameter in pixels: of its size at the eye, where that is known."""
    if viewing_m is None or px_per_m is None:
        return DISC * height
    return 2.0 * viewing_m * math.tan(math.radians(DISC_DEG) / 2.0) * px_per_m


def _disc(radius: float) -> Any:
    data = core.GeomVertexData("disc", core.GeomVertexFormat.get_v3(), core.Geom.UH_static)
    writer = core.GeomVertexWriter(data, "vertex")
    fan = core.GeomTrifans(core.Geom.UH_static)
    for at in range(SIDES):
        angle = 2.0 * math.pi * at / SIDES
        writer.add_data3(radius * math.cos(angle), 0.0, radius * math.sin(angle))
    fan.add_consecutive_vertices(0, SIDES)
    fan.close_primitive()
    geom = core.Geom(data)
    geom.add_primitive(fan)
    node = core.GeomNode("disc")
    node.add_geom(geom)
    return node


def _place(part: Any, colour: tuple[float, ...], above: int) -> None:
    part.set_color(*colour)
    part.set_two_sided(True)
    part.set_bin("fixed", ORDER + above)
