"""One camera of a view: its position, its picture and its timing."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from panda3d import core

from labcrane import FloatArray, Frame, Machine, ProtocolError
from labcrane_view.areas import Projection, axes_of
from labcrane_view.framing import framed
from labcrane_view.scene.backdrop import Backdrop
from labcrane_view.scene.stage import SCENERY, Stage
from labcrane_view.screen.placement import Piece
from labcrane_view.screen.window import SEEN, Window, hidden_picture
from labcrane_view.settings import CameraSettings

NEAR, FAR = 0.15, 170.0
ROUNDING_S = 1e-9


@dataclass(frozen=True, slots=True)
class Viewport:
    """The camera's part of the window, in pixels: ``left`` counts from the window's left edge.

    Attributes
    ----------
    picture
        Width and height of the camera's whole picture, with the parts that no monitor shows.
    pieces
        Parts of the picture, and their places in the window.
    """

    left: int
    width: int
    height: int
    picture: tuple[int, int]
    pieces: tuple[Piece, ...]


class DelayLine:
    """Gives the frame of a while ago.

    Parameters
    ----------
    delay_s
        How long ago, in seconds of the session.
    """

    def __init__(self, delay_s: float) -> None:
        self._delay = delay_s
        self._past: deque[Frame] = deque()

    def of(self, frame: Frame) -> Frame:
        """Return the newest frame that is old enough, the oldest there is until one is."""
        if self._delay == 0.0:
            return frame
        self._past.append(frame)
        latest = frame.tick.due - self._delay + ROUNDING_S
        while len(self._past) > 1 and self._past[1].tick.due <= latest:
            self._past.popleft()
        return self._past[0]


class Camera:
    """A camera that is fixed in the scene or attached to a link.

    A camera with its own frame rate or delay is drawn into a picture, which the window shows until
    the next one is due.

    Attributes
    ----------
    boxes
        The areas of interest in its picture.
    part
        Place of its picture in the window, once the camera is open.
    seen
        Time of the content of its picture, in seconds.
    """

    def __init__(self, settings: CameraSettings, machine: Machine) -> None:
        if settings.on is not None and settings.on not in machine.names:
            raise ProtocolError(
                f"camera {settings.name!r} is attached to {settings.on!r}, which this machine does "
                "not have; "
                f"it has {', '.join(machine.names)}"
            )
        self.settings = settings
        self._machine = machine
        self._look: Sequence[float] = () if settings.look == "targets" else settings.look
        self._fov_deg = settings.fov_deg
        self._delay = DelayLine(settings.delay_s)
        self._due = -math.inf
        self._backdrops: list[Backdrop] = []
        self.boxes: list[float] = []
        self.seen = math.nan

    @property
    def demands(self) -> str | None:
        """What it does that only OpenGL can, in words; None for nothing."""
        if self.settings.shows == "depth":
            return f"camera {self.settings.name!r} shows depth"
        if self.apart:
            return f"camera {self.settings.name!r} has a rate or a delay of its own"
        return None

    @property
    def apart(self) -> bool:
        """Whether the camera has a separate picture, with its own frame."""
        return self.settings.rate_hz is not None or self.settings.delay_s > 0.0

    def open(
        self,
        window: Window,
        stage: Stage,
        target: Any,
        part: Viewport,
        back: Sequence[float],
        must_see: FloatArray,
    ) -> Any:
        """Make the camera's region in ``target``; return its separate picture, if it has one.

        A camera with ``look: targets`` must show the points ``must_see``, shape ``(n, 3)``.
        """
        deep = self.settings.shows == "depth"
        self._stage, self.part = stage, part
        if self.settings.look == "targets":
            width, height = part.picture
            place = np.array(self.settings.eye)
            look, self._fov_deg = framed(self.settings.name, place, must_see, width / height)
            self._look = look.tolist()
        self._node = self._stage.root.attach_new_node(self.settings.name)
        picture = None
        left = 0
        if self.apart:
            size = part.width, part.height
            self._buffer, picture = hidden_picture(window.output, self.settings.name, size, SEEN)
            self._buffer.set_active(False)
            target, left = self._buffer, part.left
        ground = (0.0, 0.0, 0.0) if deep else back
        stands = self.settings.on is None and stage.has_scenery
        self._backdrops = []
        for piece in part.pieces:
            lens = self._lens(piece)
            eye = core.Camera(self.settings.name, lens)
            mask = None if deep else stage.own_mask()
            if mask is not None and stands:
                self._backdrops.append(Backdrop(window, stage, self._node, lens, piece, mask))
                eye.set_camera_mask(mask)
            elif mask is not None:
                eye.set_camera_mask(mask | SCENERY)
            region = _region(target, piece, left)
            region.set_clear_color_active(True)
            region.set_clear_color(core.LColor(*ground, 1.0))
            region.set_clear_depth_active(True)
            region.set_camera(self._node.attach_new_node(eye))
            if deep:
                self._stage.see_depth(eye, *self.settings.depth_m)
        return picture

    def _lens(self, piece: Piece) -> Any:
        """Return a lens for a piece: the frustum of the whole picture, cut off at its edges."""
        width, height = self.part.picture
        lens = core.PerspectiveLens()
        lens.set_film_size(piece.width, piece.height)
        lens.set_focal_length(width / 2.0 / math.tan(math.radians(self._fov_deg) / 2.0))
        aside = piece.x + piece.width / 2.0 - width / 2.0
        up = height / 2.0 - piece.y - piece.height / 2.0
        lens.set_film_offset(aside, up)
        lens.set_near_far(NEAR, FAR)
        return lens

    def drawn(self) -> None:
        """Note that a picture was drawn."""
        for backdrop in self._backdrops:
            backdrop.drawn()

    def take(self, frame: Frame) -> Frame | None:
        """Take a frame; return the frame to draw now, None while the last picture stays."""
        past = self._delay.of(frame)
        now, rate = frame.tick.due, self.settings.rate_hz
        if now < self._due - ROUNDING_S:
            return None
        if rate is not None:  # on a grid: a late picture does not make the following ones late
            self._due = (math.floor(now * rate + ROUNDING_S) + 1) / rate
        return past

    def aim(self, poses: FloatArray) -> Projection:
        """Look from where it is now: ``poses`` as of :func:`labcrane.machines.link_frames`."""
        eye, look = (self._in_base(point, poses) for point in (self.settings.eye, self._look))
        right, forward, up = axes_of(eye, look)
        rows = [*right, 0.0, *forward, 0.0, *up, 0.0, *eye, 1.0]
        self._node.set_mat(core.LMatrix4f(*(float(value) for value in rows)))
        part = self.part
        return Projection(eye, look, self._fov_deg, part.left, *part.picture, pieces=part.pieces)

    def see(self) -> None:
        """Tell the shader that this is the eye."""
        self._stage.look_from(self._node)

    def draw(self, window: Window, others: Sequence[Any]) -> None:
        """Draw its own picture, and nothing into ``others``, the outputs that show pictures."""
        for other in others:
            other.set_active(False)
        self._buffer.set_active(True)
        self.see()
        window.engine.render_frame()
        self._buffer.set_active(False)
        for other in others:
            other.set_active(True)

    def _in_base(self, point: Sequence[float], poses: FloatArray) -> FloatArray:
        if self.settings.on is None:
            return np.array(point)
        pose = poses[1 + self._machine.names.index(self.settings.on)]
        return np.asarray(pose[:3, :3] @ np.array(point) + pose[:3, 3])


def _region(target: Any, piece: Piece, left: int) -> Any:
    """Return the region of ``target`` for a piece; its left edge is the window's ``left``."""
    width, height = target.get_x_size(), target.get_y_size()
    start, top = piece.left - left, height - piece.top
    return target.make_display_region(
        start / width, (start + piece.width) / width, (top - piece.height) / height, top / height
    )
