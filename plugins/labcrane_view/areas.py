"""Areas of interest for eye tracking: where things are in the picture, in pixels."""

import math
from collections.abc import Sequence

import numpy as np

from labcrane import FloatArray, Frame, Run
from labcrane.core import Shape, Sphere
from labcrane.machines import PlacedObject, Segment, read_placed, rotation_matrix, segments, stands
from labcrane_view.scene.outline import of_body, of_segment
from labcrane_view.screen.placement import Piece

TIP = 0.12
"""Radius in metres of the tip's area of interest."""

Box = tuple[float, float, float, float]
"""Left, top, right and bottom, in pixels."""

STRAIGHT = 0.999
NOWHERE: Box = (math.nan,) * 4


class Projection:
    """A camera's way from metres to pixels, y down from the upper left corner.

    Parameters
    ----------
    eye, look
        In metres, in the base frame, shape ``(3,)``.
    fov_deg
        Horizontal field of view, in degrees.
    left, width, height
        Of the camera's picture, in pixels; ``left`` counts from the window's left edge.
    pieces
        Which parts of the picture are where in the window, if it is not there in one piece.
    """

    def __init__(
        self,
        eye: FloatArray,
        look: FloatArray,
        fov_deg: float,
        left: int,
        width: int,
        height: int,
        pieces: Sequence[Piece] = (),
    ) -> None:
        self._eye = eye
        self._axes = axes_of(eye, look)
        self._scale = width / 2.0 / math.tan(math.radians(fov_deg) / 2.0)
        self._width, self._height = width, height
        self._pieces = pieces or (Piece(left, 0, width, height, 0, 0),)

    def ball(self, centre: FloatArray, radius: float) -> Box:
        """Return left, top, right and bottom of a sphere; NaN where it is not to be seen.

        The outline of a sphere in perspective, exactly: the rays that touch it, not its diameter.
        """
        x, y, z = (self._axes @ (centre - self._eye)).tolist()
        if y <= radius:
            return NOWHERE
        across, up = _tangents(x, y, radius), _tangents(z, y, radius)
        middle_x, middle_y = self._width / 2.0, self._height / 2.0
        box = (
            middle_x + self._scale * across[0],
            middle_y - self._scale * up[1],
            middle_x + self._scale * across[1],
            middle_y - self._scale * up[0],
        )
        return self._clipped(box)

    def points(self, corners: FloatArray) -> Box:
        """Return the box around points, shape ``(n, 3)``; NaN when one is behind the eye."""
        seen = (corners - self._eye) @ self._axes.T
        if (seen[:, 1] <= 0.0).any():
            return NOWHERE
        x = self._width / 2.0 + self._scale * seen[:, 0] / seen[:, 1]
        y = self._height / 2.0 - self._scale * seen[:, 2] / seen[:, 1]
        return self._clipped((float(x.min()), float(y.min()), float(x.max()), float(y.max())))

    def _clipped(self, box: Box) -> Box:
        """Return where the part of a box that is to be seen is in the window."""
        seen = [part for piece in self._pieces if (part := _within(piece, box)) is not None]
        if not seen:
            return NOWHERE
        lefts, tops, rights, bottoms = zip(*seen, strict=True)
        return min(lefts), min(tops), max(rights), max(bottoms)


def _within(piece: Piece, box: Box) -> Box | None:
    """Return the part of a box of the picture that a piece shows, in the window; None for none."""
    left, top, right, bottom = box
    first, last = float(piece.x), float(piece.x + piece.width)
    upper, lower = float(piece.y), float(piece.y + piece.height)
    if right < first or left > last or bottom < upper or top > lower:
        return None
    x, y = piece.left - piece.x, piece.top - piece.y
    return max(left, first) + x, max(top, upper) + y, min(right, last) + x, min(bottom, lower) + y


def axes_of(eye: FloatArray, look: FloatArray) -> FloatArray:
    """Return a camera's axes in the base frame, as rows: right, forward, up."""
    forward = (look - eye) / np.linalg.norm(look - eye)
    sky = np.array([0.0, 0.0, 1.0])
    if abs(forward @ sky) > STRAIGHT:  # straight down: ahead is up in the picture
        sky = np.array([1.0, 0.0, 0.0])
    right = np.cross(forward, sky)
    right = right / np.linalg.norm(right)
    return np.stack([right, forward, np.cross(right, forward)])


def _tangents(aside: float, ahead: float, radius: float) -> tuple[float, float]:
    """Return the slopes of both rays from the eye that touch a circle."""
    root = radius * math.sqrt(aside * aside + ahead * ahead - radius * radius)
    square = ahead * ahead - radius * radius
    return (aside * ahead - root) / square, (aside * ahead + root) / square


def turned(box: Box, size: tuple[int, int], flip: str) -> Box:
    """Return where a box is once the picture has been turned over."""
    left, top, right, bottom = box
    if flip == "horizontal":
        return size[0] - right, top, size[0] - left, bottom
    if flip == "vertical":
        return left, size[1] - bottom, right, size[1] - top
    return box


class Areas:
    """The boxes of what is named, camera by camera."""

    def __init__(self, names: Sequence[str], run: Run, size: tuple[int, int], flip: str) -> None:
        self._names, self._size, self._flip = names, size, flip
        self._tip = run.state.find("tip.position")
        self._state = run.state
        self._said = {signal.name for signal in run.state.signals}
        self._bodies = [(body, of_body(body)) for body in run.bodies if body.name in names]
        self._scene = ""
        self._things: list[tuple[PlacedObject, Segment, FloatArray]] = []

    def update(self, scene: str) -> None:
        """Take up what stands around, as of :func:`labcrane.machines.read_placed`."""
        if scene != self._scene:
            self._scene = scene
            self._things = [
                (thing, segment, of_segment(thing, segment.parts))
                for thing in read_placed(scene)
                if thing.name in self._names
                for segment in segments(thing)
            ]

    def of(
        self, projection: Projection, frame: Frame, shapes: Sequence[Shape], poses: FloatArray
    ) -> list[float]:
        """Return left, top, right and bottom of every area, one after the other."""
        balls = {shape.name: shape for shape in shapes if isinstance(shape, Sphere)}
        x, y, z = frame.state[self._tip].tolist()
        balls["tip"] = Sphere("tip", (x, y, z), TIP, (0.0, 0.0, 0.0, 0.0))
        outlines = self._outlines(frame.state, poses)
        boxes: list[float] = []
        for name in self._names:
            if name in balls:
                ball = balls[name]
                box = projection.ball(np.array(ball.centre), ball.radius)
            elif name in outlines:
                box = projection.points(outlines[name])
            else:
                box = NOWHERE
            boxes += turned(box, self._size, self._flip)
        return boxes

    def _outlines(self, state: FloatArray, poses: FloatArray) -> dict[str, FloatArray]:
        """Return points around links and things where they are now, shape ``(n, 3)`` each."""
        found = {}
        for body, points in self._bodies:
            pose = self._moved(body.moves, state) if body.moves else poses[body.frame]
            found[body.name] = points @ pose[:3, :3].T + pose[:3, 3]
        whole: dict[str, list[FloatArray]] = {}
        for thing, segment, points in self._things:
            moves = f"scene.{segment.name}"
            if f"{moves}.position" in self._said:
                pose = self._moved(moves, state)
            else:
                where, yaw = stands(thing, segment.parts[0])
                pose = _pose(where, _turned(yaw))
            whole.setdefault(thing.name, []).append(points @ pose[:3, :3].T + pose[:3, 3])
        return found | {name: np.vstack(points) for name, points in whole.items()}

    def _moved(self, name: str, state: FloatArray) -> FloatArray:
        """Return the pose that the state says, shape ``(4, 4)``."""
        turn = rotation_matrix(state[self._state.find(f"{name}.orientation")])
        return _pose(state[self._state.find(f"{name}.position")].tolist(), turn)


def _pose(position: Sequence[float], turn: FloatArray) -> FloatArray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, position
    return pose


def _turned(yaw: float) -> FloatArray:
    return rotation_matrix((0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)))
