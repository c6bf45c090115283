"""Overlay of the picture: text, the photodiode's patch, and the turned-over picture."""

from collections.abc import Sequence
from typing import Any

from panda3d import core

from labcrane_view.screen.placement import Piece
from labcrane_view.settings import PatchSettings

LINE = 0.034
"""Height of a line of text, as a share of the window's height."""

NOTICE = 0.05
"""Height of a line of instructions, which operators must not miss; not below that of other text."""

CARD = (0.05, 0.06, 0.07, 0.75)
"""Colour and opacity of the ground of text: on white, too, the contrast is 7 to 1 (WCAG, AAA)."""

WIDE, TALL = 0.8, 0.9
"""Longest line of it, and most that all lines take, as shares of the window's width and height."""

CURTAIN = (0.05, 0.06, 0.07, 0.75)
"""Colour and opacity of the layer that dims the picture while the session is paused or stopped."""

SPREAD, HIGH = 0.8, 0.25
"""Most that its words take, as shares of the window's width and, for a line, of its height."""

FINE = 512
"""Pixels of a line in which a letter is measured."""

SMALLER = 0.95
"""Each time that text does not fit."""

Box = tuple[int, int, int, int]
"""Left, bottom, width and height, in pixels from the window's lower left corner."""


def capital(font: Any) -> float:
    """Return how high capitals and digits are, as a share of the line."""
    node = core.TextNode("capital")
    if isinstance(font, core.DynamicTextFont):  # an edge of some of its pixels is not the letter's
        font = font.make_copy()
        font.clear()
        font.set_pixels_per_unit(FINE)
    node.set_font(font)
    node.set_text("H")
    low, high = core.NodePath(node.generate()).get_tight_bounds()
    return float(high[2] - low[2])


class Overlay:
    """Flat things in pixels: x to the right, y up, from the lower left corner.

    Parameters
    ----------
    pieces
        The monitors' parts of the window: text lies within the first one, the state on each.
    line_px
        Height of a line of text; a share of the window's by default.
    """

    def __init__(
        self,
        output: Any,
        size: tuple[int, int],
        sort: int,
        pieces: Sequence[Piece] = (),
        line_px: float | None = None,
    ) -> None:
        self._size = size
        self._pieces = pieces or (Piece(0, 0, *size, 0, 0),)
        self._line = line_px or LINE * self._pieces[0].height
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

    def text(self, font: Any, aside: int = 0) -> "Text":
        """Return a new block of text in the upper left corner, ``aside`` pixels from its edge."""
        left, bottom, width, height = self._corner(self._pieces[0])
        return Text(self, (left + aside, bottom, width - aside, height), font, self._line)

    def notice(self, font: Any) -> "Text":
        """Return a new block of text in the lower middle, for what is to be read now."""
        line = max(self._line, NOTICE * self._pieces[0].height)
        return Text(self, self._corner(self._pieces[0]), font, line, notice=True)

    def curtain(self, font: Any) -> "Curtain":
        """Return a new state that covers the whole picture while it holds."""
        return Curtain(self, self._size, [self._corner(each) for each in self._pieces], font)

    def _corner(self, piece: Piece) -> Box:
        """Return left, bottom, width and height of a monitor's part."""
        return piece.left, self._size[1] - piece.top - piece.height, piece.width, piece.height

    def picture(self, part: tuple[int, int], texture: Any) -> None:
        """Fill the window from one x to another with a picture."""
        maker = core.CardMaker("part")
        maker.set_frame(*part, 0, self._size[1])
        card = self.root.attach_new_node(maker.generate())
        card.set_texture(texture)

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

    def __init__(
        self, overlay: Overlay, box: Box, font: Any, line_px: float, *, notice: bool = False
    ) -> None:
        self._node = core.TextNode("text")
        self._node.set_font(font)
        self._node.set_text_color(1.0, 1.0, 1.0, 1.0)
        self._node.set_card_color(*CARD)
        self._node.set_card_as_margin(0.5, 0.6, 0.35, 0.25)
        self._node.set_bin("fixed")  # the card first, then the text over it
        self._node.set_draw_order(10)
        left, bottom, _, height = box
        self._place = overlay.root.attach_new_node(self._node)
        self._place.set_transparency(core.TransparencyAttrib.M_alpha)
        self._place.set_scale(line_px)
        self._place.set_pos(left + line_px, 0.0, bottom + height - 1.6 * line_px)
        if notice:
            self._node.set_align(core.TextNode.A_center)
        self._notice = notice
        self._box, self._line = box, line_px
        self._shown = ""

    def show(self, lines: Sequence[str]) -> None:
        """Show ``lines``."""
        text = "\n".join(lines)
        if text != self._shown:  # laying out text takes longer than drawing it
            self._shown = text
            self._node.set_text(text)
            if self._notice:
                self._fit()

    def _fit(self) -> None:
        """Set it above the lower edge, smaller when it would reach beyond the upper one."""
        left, bottom, width, height = self._box
        line = self._line
        self._node.set_wordwrap(WIDE * width / line)
        while line * self._node.get_height() > TALL * height:
            line *= SMALLER
            self._node.set_wordwrap(WIDE * width / line)
        self._place.set_scale(line)
        up = bottom + line * (1.5 - self._node.get_bottom())
        self._place.set_pos(left + 0.5 * width, 0.0, up)


class Curtain:
    """One word over the whole, dimmed picture, so that operators do not continue by mistake."""

    def __init__(
        self, overlay: Overlay, size: tuple[int, int], boxes: Sequence[Box], font: Any
    ) -> None:
        self._root = overlay.root.attach_new_node("curtain")
        self._root.set_transparency(core.TransparencyAttrib.M_alpha)
        maker = core.CardMaker("curtain")
        maker.set_frame(0, size[0], 0, size[1])
        card = self._root.attach_new_node(maker.generate())
        card.set_color(*CURTAIN)
        card.set_bin("fixed", 30)
        self._node = core.TextNode("state")
        self._node.set_font(font)
        self._node.set_text_color(1.0, 1.0, 1.0, 1.0)
        self._node.set_align(core.TextNode.A_center)
        self._node.set_bin("fixed")
        self._node.set_draw_order(40)
        self._places = [(box, self._root.attach_new_node("place")) for box in boxes]
        for _, place in self._places:
            place.attach_new_node(self._node)
        self._shown = ""
        self._root.hide()

    def show(self, words: Sequence[str]) -> None:
        """Show words in the middle, as large as they fit; none takes the curtain away."""
        text = "\n".join(words)
        if text == self._shown:
            return
        self._shown = text
        if not text:
            self._root.hide()
            return
        self._node.set_text(text)
        middle = 0.5 * (self._node.get_top() + self._node.get_bottom())
        for (left, bottom, width, height), place in self._places:
            scale = min(SPREAD * width / self._node.get_width(), HIGH * height)
            place.set_scale(scale)
            place.set_pos(left + 0.5 * width, 0.0, bottom + 0.5 * height - scale * middle)
        self._root.show()
