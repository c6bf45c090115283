"""Backdrop of a camera that stands still: the scenery drawn once, and shown below what moves.

Once with sun, once without, and its depth: colour is linear in sunlight, so that both mixed by the
shadows of what moves equal a full drawing. Baked shadows would be wrong on trees.
"""

from typing import Any

from panda3d import core

from labcrane_view.scene.stage import SCENERY, STILL_PICTURES, Stage
from labcrane_view.screen.placement import Piece
from labcrane_view.screen.window import BAKED, Window

LIT, SHADED = core.LVector2(1.0, 1.0), core.LVector2(0.0, 1.0)
"""Sunlight in the two pictures: as the scenery's own shadows let it through, and none."""


class Backdrop:
    """Pictures of the scenery as a camera sees it, and a sheet that shows them.

    The colour of a surface is linear in how much sun falls on it, so that two pictures, one with
    and one without the sun, hold every shadow that something may cast. The sheet mixes them by the
    map of moving shadows, and writes the depth of what it shows: what is drawn afterwards stands
    before or behind trees as if they had been drawn with it.

    Parameters
    ----------
    node
        Where the camera stands.
    lens
        Its lens.
    piece
        What of its picture is shown.
    mask
        The camera's own.
    """

    def __init__(
        self, window: Window, stage: Stage, node: Any, lens: Any, piece: Piece, mask: Any
    ) -> None:
        sheet = core.CardMaker("backdrop")
        sheet.set_frame(-1.0, 1.0, -1.0, 1.0)
        shown = node.attach_new_node(sheet.generate())
        shown.node().set_bounds(core.OmniBoundingVolume())
        shown.node().set_final(True)
        # Without a test there would be no depth written either.
        shown.set_attrib(core.DepthTestAttrib.make(core.RenderAttrib.M_always))
        shown.set_bin("background", 1)
        self._left = STILL_PICTURES + 1
        self._buffers: list[Any] = []
        stage.add_sheet(shown, mask)
        size, depth = (piece.width, piece.height), _texture("depth")
        sunlit = self._drawn(window, node, lens, size, LIT, depth)
        shaded = self._drawn(window, node, lens, size, SHADED, None)
        shown.set_shader_inputs(sunlit=sunlit, shaded=shaded, depth=depth)

    def _drawn(
        self, window: Window, node: Any, lens: Any, size: tuple[int, int], sun: Any, depth: Any
    ) -> Any:
        """Return a picture of the scenery; what is in it is drawn with the next pictures."""
        colour = _texture("colour")
        form = core.FrameBufferProperties()
        form.set_rgba_bits(8, 8, 8, 0)
        form.depth_bits = 24  # with 32 Mesa mixes no samples
        form.multisamples = window.output.get_fb_properties().get_multisamples()
        buffer = window.output.make_texture_buffer(
            name="backdrop", x_size=size[0], y_size=size[1], tex=colour, fbp=form
        )
        if depth is not None:
            buffer.add_render_texture(
                depth, core.GraphicsOutput.RTM_bind_or_copy, core.GraphicsOutput.RTP_depth
            )
        buffer.set_sort(window.output.get_sort() + BAKED)
        eye = core.Camera("backdrop", lens)
        eye.set_camera_mask(SCENERY)
        state = core.NodePath("sun")
        state.set_shader_input("sunshine", sun, 100)
        eye.set_initial_state(state.get_state())
        region = buffer.make_display_region()
        region.set_camera(node.attach_new_node(eye))
        self._buffers.append(buffer)
        return colour

    def drawn(self) -> None:
        """Be told that a picture was drawn: once the shadows are there, it stays as it is."""
        if self._left:
            self._left -= 1
            if not self._left:
                for buffer in self._buffers:
                    buffer.set_active(False)


def _texture(name: str) -> Any:
    texture = core.Texture(name)
    texture.set_minfilter(core.SamplerState.FT_nearest)
    texture.set_magfilter(core.SamplerState.FT_nearest)
    return texture
