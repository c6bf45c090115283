"""The view: one window, one or more cameras in it."""

import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from panda3d import core

from labcrane import DeviceError, Feedback, FloatArray, Frame, Machine, PluginError, Run, Signal
from labcrane.core import CameraImage, Cylinder, SessionState, Shape, TargetFinder, Value
from labcrane.machines import link_frames
from labcrane_view.areas import Areas
from labcrane_view.camera import Camera, DelayLine, Viewport
from labcrane_view.fixation import FixationTarget, disc_px
from labcrane_view.framing import must_be_seen
from labcrane_view.gaze_markers import GazeMarker, described, drawn, placed
from labcrane_view.hud import WORDS, Hud, notice, standing
from labcrane_view.keys import Keys
from labcrane_view.overlay import Overlay, capital
from labcrane_view.quality import LEVELS, Level, chosen, picture_s
from labcrane_view.scene.daylight import DAY
from labcrane_view.scene.stage import Stage
from labcrane_view.screen.placement import PictureSpan, Piece, WindowPlacer, monitor_of, per_metre
from labcrane_view.screen.refresh import Refresh, refresh_of
from labcrane_view.screen.window import TURNED, Window, font, font_name, hidden_picture, open_window
from labcrane_view.settings import ViewSettings
from labcrane_view.shots import Shots

BOX = ("left", "top", "right", "bottom")
PREVIEW_S = 0.5
"""Between two pictures of a preview, in seconds."""

SPOT, SPOT_COLOUR = 0.22, (0.02, 0.02, 0.02, 1.0)
PLUMB, LINE_COLOUR = 0.012, (0.95, 0.95, 0.95, 1.0)
"""Radii in metres, and colours, of the cues for the height of the tip."""

STEM = (0.75, 0.75, 0.72, 1.0)


class View(Feedback):
    """Draws the newest frame, and says when it was on the screen."""

    signals = (
        Signal("shown.tick", "1"),  # what the picture shows: an older frame when there is a delay
        Signal("render.began", "s"),
        Signal("flip.time", "s"),  # the picture is handed to the screen; the photodiode knows more
        Signal("patch", "1"),
        Signal("refresh.missed", "1"),  # refreshes that showed the picture before once more
        Signal("monitors.lost", "1"),  # of those that it fills: their pictures are not visible
    )

    def __init__(self, settings: ViewSettings, machine: Machine) -> None:
        cameras = (settings.camera, *settings.beside)
        self.streams: Mapping[str, tuple[Signal, ...]] = {
            "areas": tuple(
                Signal(f"{camera.name}.{name}".replace(" ", "_"), "px", BOX)
                for camera in cameras
                for name in settings.areas
            )
        }
        self._shots = Shots(settings)
        self.cameras = self._shots.names
        self._keys = Keys(settings.keys) if settings.keys else None
        if self._keys:
            self.streams = {**self.streams, "keys": (Signal("key", "1", settings.keys),)}
        self._settings = settings
        self._machine = machine
        self._window: Window | None = None
        self._situation = SessionState()
        self._delay = DelayLine(settings.delay_s)
        self._due = self._now = 0.0
        self._samples: dict[str, FloatArray] = {}
        self._letters: Any = None
        self._quality = ""
        self._refresh = Refresh()
        self._markers: list[GazeMarker] = []
        self._px_per_m: float | None = None
        # Made before there is a window: a camera on a link that does not exist is refused at once.
        self._cameras = [Camera(camera, machine) for camera in cameras]

    def open(self, run: Run) -> None:
        wanted = self._settings.quality
        if wanted == "auto":
            level, self._quality = chosen(lambda each: self._measured(run, each))
            if self._window is not None and self._level == level:
                return
            self.close()
        else:
            level = self._quality = wanted
        self._open(run, level)

    def _measured(self, run: Run, level: Level) -> float:
        """Open with a quality; return how long a picture takes, in seconds."""
        self.close()
        self._open(run, level)
        return picture_s(self.redraw)

    def _open(self, run: Run, level: Level) -> None:
        settings, quality = self._settings, LEVELS[level]
        self._level = level
        self._angles = run.state.find("joint.angle")
        self._targets = TargetFinder(run.task)
        window = self._window = open_window(
            settings,
            self.title or "labcrane",
            [view for view in self.before if isinstance(view, ViewSettings)],
            quality.samples,
        )
        self._placer = WindowPlacer(settings, window.span.place)
        if not window.shaders:
            self._check_simple()
        output = window.output
        self._size = (output.get_x_size(), output.get_y_size())
        scenery = settings.content == "scene"
        shadow = quality.shadow if settings.shadow is None else settings.shadow
        self.stage = Stage(
            run, DAY, shaders=window.shaders, shadow=shadow, scenery=scenery, soft=quality.soft
        )
        if "ground_grid" in settings.depth_cues:
            self.stage.grid()
        if quality.samples and window.shaders:
            self.stage.root.set_antialias(core.AntialiasAttrib.M_multisample)
        self._hud = Hud(settings.hud_lines, settings.language, run)
        self._areas = Areas(settings.areas, run, self._size, settings.flip)
        back = DAY.haze if scenery else (0.0, 0.0, 0.0)
        target: Any = output
        if settings.flip != "none":
            target = self._turned_over(output)
        target.set_clear_color(core.LColor(*back, 1.0))
        self._pictures = [output] if target is output else [output, target]
        pieces, letters = window.span.pieces, font()
        self._letters = letters
        self._line_px = _line(settings, letters)
        overlay = Overlay(target, self._size, 20, pieces, self._line_px)
        parts = _parts(self._size, len(self._cameras), window.span)
        for camera, part in zip(self._cameras, parts, strict=True):
            picture = camera.open(window, self.stage, target, part, back, must_be_seen(run))
            if picture is not None:
                overlay.picture((part.left, part.left + part.width), picture)
        self._markers = self._gaze_markers(overlay, parts[0].pieces)
        aside = settings.gaze_markers.size if settings.gaze_markers else 0
        self._text = overlay.text(letters, aside) if settings.hud_lines else None
        self._notice = overlay.notice(letters) if settings.notices else None
        told = settings.notices or settings.hud_lines
        self._paused = overlay.curtain(letters) if told else None
        self._px_per_m = _px_per_m(settings)
        self._fixation: FixationTarget | None = None
        if settings.seen_by == "operator":
            disc = disc_px(self._size[1], settings.viewing_m, self._px_per_m)
            self._fixation = FixationTarget(overlay.root, self._size, disc)
        self._patch = overlay.patch(settings.patch) if settings.patch else None
        if self._keys:
            self._keys.open(output)
        self._refresh = refresh_of(settings, window)
        self._flipped = math.nan

    def _gaze_markers(self, overlay: Overlay, pieces: Sequence[Piece]) -> list[GazeMarker]:
        """Draw what a head-mounted eye tracker finds the picture by; return what and where."""
        settings = self._settings
        if settings.gaze_markers is None:
            return []
        if not settings.screens:  # of cameras side by side, the whole window
            pieces = (Piece(0, 0, *self._size, 0, 0),)
        height = self._size[1]
        markers = placed(settings.gaze_markers, pieces, height, settings.patch)
        for marker in markers:
            drawn(marker, height).reparent_to(overlay.root)
        return [marker.flipped(settings.flip, self._size) for marker in markers]

    def _check_simple(self) -> None:
        """Refuse what the software renderer would show as a white rectangle, or not at all."""
        mirrored = "the window is flipped" if self._settings.flip != "none" else None
        demands = [mirrored, *(camera.demands for camera in self._cameras)]
        if asked := next(filter(None, demands), None):
            raise DeviceError(
                f"{asked}, which the software renderer cannot; use OpenGL (Mesa's drivers will do "
                "without a graphics card), or leave it out"
            )

    def _turned_over(self, output: Any) -> Any:
        """Return a hidden picture that is copied to the window, turned over, when it is drawn."""
        hidden, picture = hidden_picture(output, "picture", self._size, TURNED)
        overlay = Overlay(output, self._size, sort=0)
        overlay.turned_over(picture, self._settings.flip)
        return hidden

    def close(self) -> None:
        if self._window is not None:
            self._placer.close()
            self._window.close()
            self._window = None

    def update(self, situation: SessionState) -> None:
        self._situation = situation

    def present(self, frame: Frame) -> FloatArray:
        window = self._opened()
        if self._settings.rate_hz is not None:
            time.sleep(max(0.0, self._due - time.perf_counter()))
            self._due = time.perf_counter() + 1.0 / self._settings.rate_hz
        shown, self._now = self._delay.of(frame), frame.tick.due
        began = time.perf_counter()
        for camera in self._cameras:
            if camera.apart and (past := camera.take(shown)) is not None:
                poses, shapes = self._set(past)
                self._look(camera, past, shapes, poses)
                camera.draw(window, self._pictures)
        poses, shapes = self._set(shown)
        for camera in reversed(self._cameras):  # the shader's eye is the first one's
            if not camera.apart:
                self._look(camera, shown, shapes, poses)
        white = self._write(shown)
        self._placer.keep(window.output)
        window.engine.render_frame()
        flipped = time.perf_counter()
        self.stage.drawn(window.output.get_gsg())
        for camera in self._cameras:
            camera.drawn()
        self._samples = {"areas": np.concatenate([camera.boxes for camera in self._cameras])}
        if self._keys:
            self._samples["keys"] = self._keys.rows()
        lost, since = float(self._placer.lost), flipped - self._flipped
        self._flipped = flipped
        missed = math.nan if math.isnan(since) else self._refresh.missed(since)
        return np.array([shown.tick.number, began, flipped, white, missed, lost])

    def samples(self) -> Mapping[str, FloatArray]:
        return self._samples

    def pictures(self) -> Mapping[str, CameraImage]:
        due = self._shots.are_due(self._now)
        return self._shots.cut(self.picture(), self._cameras) if due else {}

    def metadata(self) -> Mapping[str, Value]:
        window = self._window
        driver = "" if window is None else window.driver
        software = window is not None and window.software
        return {
            "renderer": f"{driver} (software: no graphics card takes part)" if software else driver,
            "size": self._size_in_words(),
            "quality": self._quality,
            **self._refresh.facts(),
            "samples": 1 if window is None else self._samples_a_pixel(window),
            **({"gaze_markers": described(self._markers)} if self._markers else {}),
            "seen_by": self._settings.seen_by,
            "flip": self._settings.flip,
            **({} if self._px_per_m is None else {"px_per_m": self._px_per_m}),
            **({} if self._settings.viewing_m is None else {"viewing_m": self._settings.viewing_m}),
            "font": font_name(self._letters),
            "delay": "not measured",
        }

    def _samples_a_pixel(self, window: Window) -> int:
        """Return how many there are, which may be fewer than were asked for."""
        return max(1, int(window.output.get_fb_properties().get_multisamples()))

    def _size_in_words(self) -> str:
        """Return how large the window is, and that it was to be larger."""
        width, height = self._size
        asked = self._settings.size
        if self._settings.all_screens or (width, height) == asked:
            return f"{width}x{height}"
        return f"{width}x{height} ({asked[0]}x{asked[1]} has no room beside the other windows)"

    def picture(self) -> npt.NDArray[np.uint8]:
        """Return the window's picture, shape ``(height, width, 3)``, red first, from the top."""
        found = self._opened().output.get_screenshot()
        width, height = found.get_x_size(), found.get_y_size()
        bytes_ = np.frombuffer(found.get_ram_image_as("RGB"), np.uint8)
        return bytes_.reshape(height, width, 3)[::-1].copy()

    def preview(self, run: Run, frames: Sequence[Frame], path: Path) -> Sequence[Path]:
        settings = self._settings.model_copy(
            update={"display": "hidden", "rate_hz": None, "keys": ()}
        )
        view = View(settings, self._machine)
        files = []
        try:
            view.open(run)
            view.update(self._situation)
            view.present(frames[0])
            for number, frame in enumerate(frames[:: round(PREVIEW_S * run.rate_hz)]):
                view.present(frame)
                files.append(path.with_name(f"{path.name}-{number:03}.png"))
                view.save(files[-1])
        finally:
            view.close()
        return files

    def redraw(self) -> None:
        """Draw the same picture again, to measure the rest of :meth:`present` by comparison."""
        self._opened().engine.render_frame()

    def save(self, path: Path) -> None:
        """Write the window's picture to a PNG file."""
        if self._window is None or not self._window.output.save_screenshot(
            core.Filename.from_os_specific(str(path.absolute()))  # Panda3D's own folder stays
        ):
            raise PluginError(f"the picture could not be written to {path}")

    def _opened(self) -> Window:
        if self._window is None:
            raise AssertionError("a view is opened before it presents")
        return self._window

    def _look(
        self, camera: Camera, frame: Frame, shapes: Sequence[Shape], poses: FloatArray
    ) -> None:
        """Turn a camera to where it looks now, and find what is where in its picture."""
        camera.seen = frame.tick.due
        camera.boxes = self._areas.of(camera.aim(poses), frame, shapes, poses)
        camera.see()

    def _set(self, frame: Frame) -> tuple[FloatArray, list[Shape]]:
        """Set the stage for a frame; return the machine's frames and the shapes shown."""
        poses = link_frames(self._machine, frame.state[self._angles].tolist())
        shapes = [*self._task_shapes(frame), *self._depth_shapes(poses), *frame.shapes]
        self.stage.place(poses, self._situation.scene, frame.state)
        self._areas.update(self._situation.scene)
        self.stage.show(shapes)
        return poses, shapes

    def _task_shapes(self, frame: Frame) -> list[Shape]:
        shapes: list[Shape] = []
        if not self._settings.targets:
            return shapes
        for target in self._targets.find(frame.task):
            x, y, z = target.centre
            shapes.append(target)
            if z > target.radius:
                foot, top = (x, y, 0.0), (x, y, z - target.radius)
                shapes.append(Cylinder(f"{target.name} stem", foot, top, 0.03, STEM))
        return shapes

    def _depth_shapes(self, poses: FloatArray) -> list[Shape]:
        """Return what tells how high the tip is."""
        x, y, z = poses[-1][:3, 3].tolist()
        shapes: list[Shape] = []
        if "tip_shadow" in self._settings.depth_cues:
            low, high = (x, y, 0.004), (x, y, 0.02)
            shapes.append(Cylinder("tip shadow", low, high, SPOT, SPOT_COLOUR))
        if "plumb_line" in self._settings.depth_cues and z > PLUMB:
            shapes.append(Cylinder("plumb line", (x, y, 0.0), (x, y, z), PLUMB, LINE_COLOUR))
        return shapes

    def _write(self, frame: Frame) -> float:
        """Set text and patch; return 1 when the patch is white, 0 black, NaN without."""
        if self._text is not None:
            self._text.show(self._hud.lines(frame, self._situation))
        if self._notice is not None:
            self._notice.show(
                notice(frame, self._situation, self._settings.hint_s, self._settings.language)
            )
        if self._paused is not None:
            state = standing(frame, self._situation)
            self._paused.show([WORDS[self._settings.language][state]] if state else [])
        if self._fixation is not None:  # a pause is to be seen: what holds the session is on top
            self._fixation.show(() if frame.paused else self._situation.fixation)
        if self._patch is None or self._settings.patch is None:
            return math.nan
        counts = self._situation.counts
        white = float(sum(counts.get(event, 0) for event in self._settings.patch.on) % 2)
        self._patch.set_color(white, white, white, 1.0)
        return white


def _parts(size: tuple[int, int], count: int, span: PictureSpan) -> list[Viewport]:
    """Return the parts of a window of ``size`` pixels, side by side, or its only one's pieces."""
    if count == 1:
        # A window manager may have made it smaller than it was asked for.
        only = len(span.pieces) == 1
        whole = (Piece(0, 0, *size, 0, 0),)
        picture = size if only else span.picture
        return [Viewport(0, *size, picture, whole if only else span.pieces)]
    width = size[0] // count
    one = (width, size[1])
    return [
        Viewport(at * width, *one, one, (Piece(at * width, 0, *one, 0, 0),)) for at in range(count)
    ]


def _px_per_m(settings: ViewSettings) -> float | None:
    """Return pixels in a metre of the glass; None where nobody says how large it is."""
    try:
        return per_metre(settings, monitor_of(settings))
    except DeviceError:
        return None


def _line(settings: ViewSettings, letters: Any) -> float | None:
    """Return the height of a line of text in pixels, by its size on the retina; None for usual."""
    if settings.text_arcmin is None or settings.viewing_m is None:
        return None
    high = 2.0 * settings.viewing_m * math.tan(math.radians(settings.text_arcmin / 60.0) / 2.0)
    return high * per_metre(settings, monitor_of(settings)) / capital(letters)
