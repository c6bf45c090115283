"""The view: one window, one or more cameras in it."""

import itertools
import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from panda3d import core

from labcrane import (
    Ball,
    Beam,
    Body,
    Feedback,
    FloatArray,
    Frame,
    Machine,
    PluginError,
    ProtocolError,
    Run,
    Shape,
    Signal,
    Situation,
    Targets,
    Value,
    frames,
)
from labcrane_view.areas import NOWHERE, Projection, axes_of, turned
from labcrane_view.hud import hud_lines
from labcrane_view.overlay import Overlay
from labcrane_view.settings import CameraSettings, ViewSettings
from labcrane_view.stage import HAZE, Stage
from labcrane_view.window import Window, font, open_window

BOX = ("left", "top", "right", "bottom")
TIP = 0.12
"""Radius in metres of the tip's area of interest."""

ROUNDING_S = 1e-9
PREVIEW_S = 0.5
"""Between two pictures of a preview, in seconds."""

NEAR, FAR = 0.15, 170.0
STEM = (0.75, 0.75, 0.72, 1.0)


class View(Feedback):
    """Draws the newest frame, and says when it was on the screen."""

    signals = (
        Signal("shown.tick", "1"),  # what the picture shows: an older frame when there is a delay
        Signal("render.began", "s"),
        Signal("flip.time", "s"),  # the picture is handed to the screen; the photodiode knows more
        Signal("patch", "1"),
    )

    def __init__(self, settings: ViewSettings, machine: Machine) -> None:
        self.streams: Mapping[str, tuple[Signal, ...]] = {"areas": ()}
        self._settings = settings
        self._machine = machine
        self._cameras = (settings.camera, *settings.beside)
        self._window: Window | None = None
        self._situation = Situation()
        self._past: deque[Frame] = deque()
        self._due = 0.0
        self._areas: list[float] = []
        for camera in self._cameras:
            if camera.on is not None and camera.on not in machine.names:
                raise ProtocolError(
                    f"camera {camera.name!r} rides on {camera.on!r}, which the machine has not; "
                    f"it has {', '.join(machine.names)}"
                )

    def open(self, run: Run) -> None:
        self._angles = run.state.find("joint.angle")
        self._tip = run.state.find("tip.position")
        self._speed = run.state.find("tip.velocity")
        self._targets = Targets(run.task)
        self._bodies = [body for body in run.bodies if body.name in self._settings.areas]
        self.streams = {
            "areas": tuple(
                Signal(f"{camera.name}.{name}".replace(" ", "_"), "px", BOX)
                for camera in self._cameras
                for name in self._settings.areas
            )
        }
        self._open_window(run)

    def _open_window(self, run: Run) -> None:
        settings, scenery = self._settings, self._settings.content == "scene"
        window = self._window = open_window(settings, "labcrane")
        output = window.output
        self._size = (output.get_x_size(), output.get_y_size())
        self.stage = Stage(run, shaders=window.shaders, shadow=settings.shadow, scenery=scenery)
        back = HAZE if scenery else (0.0, 0.0, 0.0)
        target: Any = output
        if settings.flip != "none":
            target = self._turned_over(output)
        target.set_clear_color(core.LColor(*back, 1.0))
        self._eyes = [self._make_camera(target, at) for at in range(len(self._cameras))]
        overlay = Overlay(target, self._size, sort=20)
        self._text = overlay.text(font(settings.font)) if settings.hud else None
        self._patch = overlay.patch(settings.patch) if settings.patch else None
        self._projections: list[Projection] = []

    def _turned_over(self, output: Any) -> Any:
        """Return a hidden picture that is copied to the window, turned over, when it is drawn."""
        picture = core.Texture("picture")
        picture.set_minfilter(core.SamplerState.FT_nearest)
        picture.set_magfilter(core.SamplerState.FT_nearest)
        hidden = output.make_texture_buffer("picture", *self._size, picture)
        hidden.set_sort(output.get_sort() - 5)  # after the shadow map, whose sort is -10
        overlay = Overlay(output, self._size, sort=0)
        overlay.turned_over(picture, self._settings.flip)
        return hidden

    def _make_camera(self, output: Any, at: int) -> Any:
        count = len(self._cameras)
        region = output.make_display_region(at / count, (at + 1) / count, 0.0, 1.0)
        lens = core.PerspectiveLens()
        width, height = self._part
        lens.set_aspect_ratio(width / height)
        lens.set_fov(self._cameras[at].fov_deg)
        lens.set_near_far(NEAR, FAR)
        node = self.stage.root.attach_new_node(core.Camera(self._cameras[at].name, lens))
        region.set_camera(node)
        region.set_sort(at)
        return node

    @property
    def _part(self) -> tuple[int, int]:
        return self._size[0] // len(self._cameras), self._size[1]

    def close(self) -> None:
        if self._window is not None:
            self._window.close()
            self._window = None

    def hear(self, situation: Situation) -> None:
        self._situation = situation

    def present(self, frame: Frame) -> FloatArray:
        window = self._window
        if window is None:
            raise AssertionError("a view is opened before it presents")
        if self._settings.rate_hz is not None:
            time.sleep(max(0.0, self._due - time.perf_counter()))
            self._due = time.perf_counter() + 1.0 / self._settings.rate_hz
        shown = self._delayed(frame)
        began = time.perf_counter()
        poses = frames(self._machine, shown.state[self._angles].tolist())
        shapes = [*self._task_shapes(shown), *shown.shapes]
        self.stage.place(poses, self._situation.scene, shown.state)
        self.stage.show(shapes)
        self._projections = [self._aim(at, poses) for at in range(len(self._cameras))]
        white = self._write(shown)
        window.engine.render_frame()
        flipped = time.perf_counter()
        self._areas = self._boxes(shown, shapes, poses)
        return np.array([shown.tick.number, began, flipped, white])

    def samples(self) -> Mapping[str, FloatArray]:
        return {"areas": np.array(self._areas)}

    def facts(self) -> Mapping[str, Value]:
        window = self._window
        driver = "" if window is None else window.driver
        software = window is not None and window.software
        return {
            "renderer": f"{driver} (software: no graphics card takes part)" if software else driver,
            "size": f"{self._size[0]}x{self._size[1]}",
            "delay": "not measured",
        }

    def picture(self) -> npt.NDArray[np.uint8]:
        """Return what the window shows, shape ``(height, width, 3)``, red first, from the top."""
        if self._window is None:
            raise AssertionError("a view is opened before it is looked at")
        found = self._window.output.get_screenshot()
        width, height = found.get_x_size(), found.get_y_size()
        bytes_ = np.frombuffer(found.get_ram_image_as("RGB"), np.uint8)
        return bytes_.reshape(height, width, 3)[::-1].copy()

    def preview(self, run: Run, frames: Sequence[Frame], path: Path) -> Sequence[Path]:
        settings = self._settings.model_copy(update={"display": "hidden", "rate_hz": None})
        view = View(settings, self._machine)
        files = []
        try:
            view.open(run)
            view.hear(self._situation)
            view.present(frames[0])
            for number, frame in enumerate(frames[:: round(PREVIEW_S * run.rate_hz)]):
                view.present(frame)
                files.append(path.with_name(f"{path.name}-{number:03}.png"))
                view.save(files[-1])
        finally:
            view.close()
        return files

    def redraw(self) -> None:
        """Draw the same picture again; what the rest of :meth:`present` costs shows beside it."""
        if self._window is not None:
            self._window.engine.render_frame()

    def save(self, path: Path) -> None:
        """Write what the window shows to a PNG file."""
        if self._window is None or not self._window.output.save_screenshot(
            core.Filename.from_os_specific(str(path))
        ):
            raise PluginError(f"the picture could not be written to {path}")

    def _delayed(self, frame: Frame) -> Frame:
        if self._settings.delay_s == 0.0:
            return frame
        self._past.append(frame)
        while len(self._past) > 1 and self._past[1].tick.due <= (
            frame.tick.due - self._settings.delay_s + ROUNDING_S
        ):
            self._past.popleft()
        return self._past[0]

    def _task_shapes(self, frame: Frame) -> list[Shape]:
        shapes: list[Shape] = []
        if not self._settings.targets:
            return shapes
        for target in self._targets.find(frame.task):
            x, y, z = target.centre
            shapes.append(target)
            if z > target.radius:
                foot, top = (x, y, 0.0), (x, y, z - target.radius)
                shapes.append(Beam(f"{target.name} stem", foot, top, 0.03, STEM))
        return shapes

    def _aim(self, at: int, poses: FloatArray) -> Projection:
        """Turn a camera to where it looks now."""
        camera, node = self._cameras[at], self._eyes[at]
        eye, look = (self._in_base(camera, point, poses) for point in (camera.eye, camera.look))
        right, forward, up = axes_of(eye, look)
        rows = [*right, 0.0, *forward, 0.0, *up, 0.0, *eye, 1.0]
        node.set_mat(core.LMatrix4f(*(float(value) for value in rows)))
        if at == 0:
            self.stage.look_from(node)
        width, height = self._part
        return Projection(eye, look, camera.fov_deg, at * width, width, height)

    def _in_base(
        self, camera: CameraSettings, point: Sequence[float], poses: FloatArray
    ) -> FloatArray:
        if camera.on is None:
            return np.array(point)
        pose = poses[1 + self._machine.names.index(camera.on)]
        return np.asarray(pose[:3, :3] @ np.array(point) + pose[:3, 3])

    def _write(self, frame: Frame) -> float:
        """Set text and patch; return 1 when the patch is white, 0 black, NaN without."""
        if self._text is not None:
            tip, there = frame.state[self._tip], list(self._targets.find(frame.task))
            away = math.dist(tip, there[0].centre) if there else math.nan
            speed = float(np.linalg.norm(frame.state[self._speed]))
            language = self._settings.language
            self._text.show(
                hud_lines(self._settings.hud, language, frame, self._situation, away, speed)
            )
        if self._patch is None or self._settings.patch is None:
            return math.nan
        counts = self._situation.counts
        white = float(sum(counts.get(event, 0) for event in self._settings.patch.on) % 2)
        self._patch.set_color(white, white, white, 1.0)
        return white

    def _boxes(self, frame: Frame, shapes: Sequence[Shape], poses: FloatArray) -> list[float]:
        balls = {shape.name: shape for shape in shapes if isinstance(shape, Ball)}
        x, y, z = frame.state[self._tip].tolist()
        balls["tip"] = Ball("tip", (x, y, z), TIP, STEM)
        corners = {body.name: self._corners(body, poses) for body in self._bodies}
        boxes: list[float] = []
        for projection in self._projections:
            for name in self._settings.areas:
                if name in balls:
                    ball = balls[name]
                    box = projection.ball(np.array(ball.centre), ball.radius)
                elif name in corners:
                    box = projection.points(corners[name])
                else:
                    box = NOWHERE
                boxes += turned(box, self._size, self._settings.flip)
        return boxes

    def _corners(self, body: Body, poses: FloatArray) -> FloatArray:
        signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
        pose = poses[body.frame]
        inside = np.array(body.centre) + signs * np.array(body.size)
        return np.asarray(inside @ pose[:3, :3].T + pose[:3, 3])
