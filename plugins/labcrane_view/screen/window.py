"""Window, or a picture without a window, with any available renderer.

One window covers all monitors, as two processes would show different frames. When its monitor is
lost it keeps its size, so that pixels keep their meaning.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from panda3d import core

from labcrane import DeviceError
from labcrane_view.screen.placement import PictureSpan, placed
from labcrane_view.settings import ViewSettings

# auto-flip 1: by default Panda3D shows every picture one render_frame late. gl-finish 1: the stamp
# after a picture is only honest when the driver has drawn it.
CONFIGURATION = """
auto-flip 1
sync-video 1
gl-finish 1
gl-version 3 3
audio-library-name null
notify-level error
notify-level-display fatal
framebuffer-multisample 0
textures-power-2 none
"""


BACK_BUFFERS = 1
"""The picture is drawn off-screen and shown complete; otherwise the X server would show partial
pictures."""

SHARP = 64
"""Stored height of a line of text in pixels: larger text is slightly blurred."""

BAKED, SEEN, TURNED = -8, -7, -5
"""Sort order of backdrops, cameras' pictures and the flipped window: after the shadows (Panda3D's
-10), before the regions that show them (0)."""


@dataclass(frozen=True)
class Window:
    """Where pictures appear.

    Attributes
    ----------
    engine, output
        Panda3D's engine, and its window or buffer.
    shaders
        Whether the renderer runs our shader; the software renderer does not.
    driver
        Name of the renderer, as it reports itself.
    span
        Its place, and the places of the picture's parts in it.
    """

    engine: Any
    output: Any
    shaders: bool
    driver: str
    span: PictureSpan

    @property
    def software(self) -> bool:
        """Whether drawing does not use a graphics card."""
        return not self.shaders or any(
            word in self.driver.lower() for word in ("llvmpipe", "softpipe", "swrast")
        )

    def close(self) -> None:
        """Close the window."""
        self.engine.remove_all_windows()


def open_window(
    settings: ViewSettings, title: str, before: Sequence[ViewSettings] = (), samples: int = 0
) -> Window:
    """Open the window or hidden buffer of the settings.

    Parameters
    ----------
    before
        Views whose windows may already be on the desktop: this window is placed next to them, and
        is smaller if there is no room. A window manager may move it.
    samples
        Requested samples per pixel; the renderer may have fewer.

    Raises
    ------
    DeviceError
        There is no display, no such monitor, no room, or no renderer.
    """
    core.load_prc_file_data("labcrane", CONFIGURATION)
    hidden = settings.display == "hidden"
    if not hidden and not os.environ.get("DISPLAY"):
        raise DeviceError(
            "there is no display for a window (DISPLAY is not set); start labcrane in a desktop "
            "session, or write display: hidden to draw without a screen"
        )
    if not hidden:
        # Panda3D has its own copy of the environment, made when it was imported: it would open the
        # window on whatever display there was then.
        core.ExecutionEnvironment.set_environment_variable("DISPLAY", os.environ["DISPLAY"])
    tried = [("p3headlessgl" if hidden else "pandagl", True)] * (settings.renderer == "auto")
    for module, shaders in [*tried, ("p3tinydisplay", False)]:
        engine = core.GraphicsEngine()
        opened = _output(engine, module, settings, title, before, samples)
        if opened is None:
            continue
        output, span = opened
        return Window(engine, output, shaders, output.get_gsg().driver_renderer or module, span)
    raise DeviceError(
        "nothing can draw here: neither OpenGL nor the software renderer could be opened; check "
        f"that DISPLAY {os.environ.get('DISPLAY')!r} exists and may be used"
    )


def hidden_picture(output: Any, name: str, size: tuple[int, int], turn: int) -> tuple[Any, Any]:
    """Return what is drawn into unseen, pixel by pixel as it will be shown, and its texture."""
    picture = core.Texture(name)
    picture.set_minfilter(core.SamplerState.FT_nearest)
    picture.set_magfilter(core.SamplerState.FT_nearest)
    hidden = output.make_texture_buffer(name, *size, picture)
    hidden.set_sort(output.get_sort() + turn)
    return hidden, picture


def _output(
    engine: Any,
    module: str,
    settings: ViewSettings,
    title: str,
    before: Sequence[ViewSettings],
    samples: int,
) -> tuple[Any, PictureSpan] | None:
    selection = core.GraphicsPipeSelection.get_global_ptr()
    hidden = settings.display == "hidden"
    if module == "p3tinydisplay" and hidden:
        pipe = selection.make_pipe("TinyOffscreenGraphicsPipe", module)
    else:
        pipe = selection.make_module_pipe(module)
    if pipe is None or not pipe.is_valid():
        return None
    if module == "p3tinydisplay" and not hidden:
        # A window that is removed lets go of its pipe, which closes the connection to the X server,
        # and its destructor uses that connection: a segmentation fault, if anything still refers to
        # the window. So the connection stays until the process ends.
        pipe.ref()
    desktop = (pipe.get_display_width(), pipe.get_display_height())
    span = placed(settings, before, desktop)
    corner, size = span.place
    window = core.WindowProperties(size=size)
    window.title = title
    if not hidden:
        window.origin = core.LPoint2i(*corner)
        window.undecorated = bool(settings.all_screens)
    form = core.FrameBufferProperties()
    form.rgb_color = True
    form.set_rgba_bits(8, 8, 8, 0)
    form.depth_bits = 24
    form.multisamples = samples
    form.back_buffers = 0 if hidden else BACK_BUFFERS
    kind = core.GraphicsPipe.BF_refuse_window if hidden else core.GraphicsPipe.BF_require_window
    output = engine.make_output(
        pipe, title, 0, form, window, kind | core.GraphicsPipe.BF_fb_props_optional
    )
    if output is None:
        return None
    engine.open_windows()
    engine.render_frame()
    return (output, span) if output.is_valid() else None


def font_name(loaded: Any) -> str:
    """Return what the record calls a font."""
    return "Panda3D's own" if loaded == core.TextNode.get_default_font() else "DejaVu Sans"


def font() -> Any:
    """Return a font whose digits are all as high as capitals, with the letters of our languages.

    The renderer's own has old-style digits, in which 0.00 reads as three small letters. Matplotlib,
    which labcrane needs in any case, comes with this one, DejaVu Sans, whose licence lets everybody
    use and pass it on; it is found without being imported.
    """
    found = find_spec("matplotlib")
    folders = found.submodule_search_locations if found else None
    for folder in folders or ():
        path = Path(folder) / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"
        if path.is_file():
            loaded = core.FontPool.load_font(
                core.Filename.from_os_specific(str(path)).get_fullpath()
            )
            if loaded is not None and loaded.is_valid():
                if loaded.get_num_pages() == 0:  # not yet used
                    loaded.set_pixels_per_unit(SHARP)
                return loaded
    return core.TextNode.get_default_font()
