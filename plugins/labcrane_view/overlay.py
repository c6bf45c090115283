"""What lies flat over the picture: text, the photodiode's patch, and the turned-over picture."""

from collections.abc import Sequence
from typing import Any

from panda3d import core

from labcrane_view.settings import PatchSettings

LINE = 0.034
"""Height of a line of text, as a share of the window's height."""


class Overlay:
    """Flat things in pixels: x to the right, y up, from the lower left corner."""

    def __init__(self, output: Any, size: tuple[int, int], sort: int) -> None:
        self._size = size
        self.root = core.NodePath("overlay")
        self.root.set_depth_test(False)
        self.root.set_depth_write(False)
        lens = core.OrthographicLens()
        lens.set_film_size(*size)
        lens.set_film_offset(size[0] / 2, size[1] / 2)
        lens.set_near_far(-10.0, 10.0)
        camera = self.root.attach_new_node(core.Camera("overlay", lens))
        region = output.make_display_region()
        region.set_sort(sort)
        region.set_camera(camera)

    def turned_over(self, picture: Any, flip: str) -> None:
        """Fill the window with ``picture``, turned over horizontally or vertically."""
        width, height = self._size
        maker = core.CardMaker("picture")
        maker.set_frame(0, width, 0, height)
        right, top = (0.0, 1.0) if flip == "horizontal" else (1.0, 0.0)
        maker.set_uv_range(core.LPoint2f(1.0 - right, 1.0 - top), core.LPoint2f(right, top))
        card = self.root.attach_new_node(maker.generate())
        card.set_texture(picture)

    def text(self, font: Any) -> "Text":
        """Return a new block of text in the upper left corner."""
        return Text(self, self._size, font)

    def patch(self, settings: PatchSettings) -> Any:
        """Return a new photodiode patch."""
        width, height = self._size
        left = 0 if settings.corner.endswith("left") else width - settings.size
        bottom = 0 if settings.corner.startswith("bottom") else height - settings.size
        maker = core.CardMaker("patch")
        maker.set_frame(left, left + settings.size, bottom, bottom + settings.size)
        patch = self.root.attach_new_node(maker.generate())
        patch.set_bin("fixed", 50)
        return patch


class Text:
    """Lines of text on a dark ground."""

    def __init__(self, overlay: Overlay, size: tuple[int, int], font: Any) -> None:
        self._node = core.TextNode("text")
        self._node.set_font(font)
        self._node.set_text_color(1.0, 1.0, 1.0, 1.0)
        self._node.set_card_color(0.05, 0.06, 0.07, 0.55)
        self._node.set_card_as_margin(0.5, 0.6, 0.35, 0.25)
        self._node.set_bin("fixed")  # the card first, then the text over it
        self._node.set_draw_order(10)
        line = LINE * size[1]
        place = overlay.root.attach_new_node(self._node)
        place.set_transparency(core.TransparencyAttrib.M_alpha)
        place.set_scale(line)
        place.set_pos(1.0 * line, 0.0, size[1] - 1.6 * line)
        self._shown = ""

    def show(self, lines: Sequence[str]) -> None:
        """Show ``lines``."""
        text = "\n".join(lines)
        if text != self._shown:  # laying out text takes longer than drawing it
            self._shown = text
            self._node.set_text(text)
