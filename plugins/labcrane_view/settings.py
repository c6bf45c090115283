"""Settings of a view."""

from collections.abc import Mapping
from string import ascii_lowercase, digits
from typing import Annotated, Literal

from pydantic import (
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    ValidationInfo,
    model_validator,
)
from pydantic import PositiveInt as Pixels

from labcrane import Machine, Settings
from labcrane.core import (
    CameraName,
    EventName,
    LinkName,
    Names,
    Once,
    Preset,
    Reference,
    SceneObject,
    Unit,
    Usual,
    WrongKey,
    was_run,
)

Triple = tuple[float, float, float]


class CameraSettings(Settings):
    """Where a camera is, or the joint that it is attached to."""

    name: str = "camera"
    """Name of the camera in the picture and in the areas of interest."""

    eye: Annotated[Triple, Unit("m")]
    """Position in metres, in the machine's base frame or in that of the joint it is attached to."""

    look: Annotated[Triple, Unit("m")] | Literal["targets"]
    """Point in the middle of the picture, in the same frame. ``targets`` orients the camera once
    for the whole session, so that the picture includes all targets of the tasks, the path of the
    tip between them, and the tip at rest."""

    fov_deg: float = Field(default=70.0, gt=1.0, lt=170.0)
    """Horizontal field of view, in degrees; with ``look: targets``, it is computed."""

    on: LinkName | None = None
    """Joint to whose link the camera is attached; by default the camera is fixed in the scene."""

    shows: Literal["colour", "depth"] = "colour"
    """``depth`` shows the distance of solid objects: white at the near end of ``depth_m``, black at
    the far end and beyond."""

    depth_m: tuple[PositiveFloat, PositiveFloat] = (0.5, 20.0)
    """Near and far end of a depth picture, in metres along the line of sight."""

    rate_hz: Annotated[PositiveFloat | None, Usual(1.0, 500.0)] = None
    """Pictures per second of the session's time; as many as the window shows by default."""

    delay_s: Annotated[NonNegativeFloat, Usual(0.001, 5.0)] = 0.0
    """Delay of the camera's picture, in seconds, in addition to the window's delay."""

    @model_validator(mode="after")
    def _depth_rises(self, info: ValidationInfo) -> "CameraSettings":
        if self.look == self.eye and not was_run(info):
            raise WrongKey("look and eye are the same point; write another look", at=("look",))
        if self.look == "targets" and self.on is not None:
            raise WrongKey(
                f"a camera attached to {self.on!r} cannot keep the targets in its picture; write "
                "look: as a point",
                at=("look",),
            )
        near, far = self.depth_m
        if not near < far:
            raise WrongKey(
                f"depth_m is {near:g} to {far:g} m; the second must be farther away",
                at=("depth_m",),
            )
        return self


CAMERAS: Mapping[str, CameraSettings] = {
    "cab": CameraSettings(name="cab", eye=(-0.9, 1.8, 3.1), look="targets"),
    "cab_left": CameraSettings(name="cab_left", eye=(-2.2, 2.2, 3.3), look=(5.2, 0.3, 0.8)),
    "cab_right": CameraSettings(name="cab_right", eye=(-2.2, -2.2, 3.3), look=(5.2, -0.3, 0.8)),
    "free": CameraSettings(name="free", eye=(11.0, -9.5, 5.5), look=(3.5, 0.0, 1.2), fov_deg=60),
    "top": CameraSettings(name="top", eye=(4.5, 0.0, 15.0), look=(4.6, 0.0, 0.0), fov_deg=75),
}
"""Predefined cameras."""


Camera = Annotated[CameraSettings, Preset("camera", CAMERAS)]

KEYS = (
    *ascii_lowercase, *digits, *(f"f{number}" for number in range(1, 17)),
    "arrow_left", "arrow_right", "arrow_up", "arrow_down", "page_up", "page_down", "home", "end",
    "space", "enter", "escape", "tab", "backspace", "insert", "delete", "pause", "menu", "help",
    "shift", "lshift", "rshift", "control", "lcontrol", "rcontrol", "alt", "lalt", "ralt", "meta",
    "lmeta", "rmeta", "caps_lock", "num_lock", "scroll_lock", "shift_lock", "print_screen",
    *",.-/;=[]`",
)  # fmt: skip
"""What Panda3D calls the keys of a keyboard."""

Key = Annotated[str, Reference("key", own=True)]
"""A key of the keyboard."""

ENTERING = ("target.entered",)
"""Events that reveal whether the tip is in the target."""


class PatchSettings(Settings):
    """A square in a corner for a photodiode: it changes between black and white."""

    on: Annotated[tuple[EventName, ...], Field(min_length=1), Once()] = ("trial.start", "trial.end")
    """Events at which the square changes."""

    corner: Literal["bottom_left", "bottom_right", "top_left", "top_right"] = "bottom_left"
    """Corner of the picture."""

    size: Pixels = 60
    """Edge length, in pixels."""


GAZE_MARKER_CELLS = 10
"""Number of cells along an edge of a marker: white margin, black frame, six bits, frame, margin."""

GAZE_MARKER_CODES = 16
"""Number of codes: four for each of four monitors."""


class GazeMarkerSettings(Settings):
    """AprilTags in the corners of each monitor, by which a head-mounted eye tracker finds it."""

    first: Annotated[NonNegativeInt, Field(lt=GAZE_MARKER_CODES)] = 0
    """Number of the first marker, in the upper left corner; the others follow clockwise, then those
    of the next monitor. A second window needs different numbers."""

    size: Annotated[Pixels, Field(multiple_of=GAZE_MARKER_CELLS)] = 100
    """Edge length with the white margin, in pixels: ten cells of whole pixels."""


class SupervisorSettings(Settings):
    """The pictures that the experimenter's page shows."""

    cameras: Annotated[tuple[CameraName, ...], Once()] = ()
    """Names of the cameras; all by default."""

    rate_hz: float = Field(default=4.0, ge=1.0, le=10.0)
    """Pictures per second of the session's time."""

    width: Pixels = 480
    """Maximum width of a picture, in pixels. From a wider picture, only every second, third, ...
    pixel is sent."""


DepthCue = Literal["tip_shadow", "plumb_line", "ground_grid"]

HudLine = Literal["block", "trial", "distance", "time", "speed", "load", "lateness"]
"""What a line of text can show."""


MOST_PIXELS = 16_384
"""Maximum of a picture's edge in pixels: no screen is larger, and graphics cards refuse more."""

Screen = NonNegativeInt | Annotated[str, Field(min_length=1)]
"""A monitor: its number, counted from 0, or its name."""


class ViewSettings(Settings):
    """A window: its content, its cameras and its place."""

    camera: Camera = CAMERAS["cab_left"]
    """``cab_left``, ``cab_right``, ``free``, ``top``, or the settings of a camera."""

    beside: tuple[Camera, ...] = ()
    """Further cameras, side by side with the first in the same window."""

    size: tuple[Pixels, Pixels] = (1280, 720)
    """Width and height, in pixels; not used on a full screen."""

    screen: Screen | None = None
    """The monitor to fill: its name (``HDMI-1``), or its number, counted from 0; a window by
    default."""

    screens: Annotated[tuple[Screen, ...], Once()] = ()
    """Monitors to fill with one wide picture, from left to right, instead of ``screen``."""

    bezel_mm: Annotated[NonNegativeFloat, Usual(0.1, 300.0)] = 0.0
    """Distance between the pictures of two neighbouring ``screens``, in millimetres. This part of
    the wide picture is hidden, so that movements across the gap stay straight."""

    screen_mm: Annotated[PositiveFloat | None, Usual(50.0, 10_000.0)] = None
    """Width of one monitor's visible picture, in millimetres; the monitor's value by default."""

    flip: Literal["none", "horizontal", "vertical"] = "none"
    """Flips the picture, for a mirror."""

    content: Literal["scene", "feedback"] = "scene"
    """``feedback`` shows targets and cues on black: for a semi-transparent mirror on a table."""

    seen_by: Literal["operator", "examiner"] = "operator"
    """Who sees the view. If it shows the operator the distance to the goal, that is feedback, and
    belongs to the design."""

    hud: Annotated[tuple[HudLine, ...], Once()] | None = None
    """Lines of text in the corner; block and trial by default; for the experimenter the distance to
    the target as well. ``load`` is the load of each joint, if the machine reports it."""

    notices: bool = True
    """Whether the view shows texts to the operator: instructions, questions, hints."""

    hint_s: Annotated[PositiveFloat, Usual(0.5, 800.0)] = 8.0
    """How long a hint is shown, in seconds."""

    language: Literal["en", "de", "pl"] = "en"
    """Language of the text in the view."""

    text_arcmin: Annotated[PositiveFloat | None, Usual(5.0, 180.0)] = None
    """Height of capitals and digits as a visual angle, in minutes of arc (ISO 9241-303 requires at
    least 16, and recommends 20 to 22); a fixed share of the window's height by default."""

    viewing_m: Annotated[PositiveFloat | None, Unit("m"), Usual(0.1, 10.0)] = None
    """Distance from the eye to the screen, in metres; ``text_arcmin`` needs it."""

    targets: bool = True
    """Whether targets are drawn."""

    depth_cues: tuple[DepthCue, ...] = ()
    """Cues for the height of the tip and its place above the ground: a spot below it, a line down
    to the ground, a grid of lines on the ground, one metre apart. Every group sees them, because a
    view has the same settings in all groups."""

    delay_s: Annotated[NonNegativeFloat, Usual(0.001, 5.0)] = 0.0
    """Delay of the picture, in seconds, as in teleoperation."""

    rate_hz: Annotated[PositiveFloat | None, Usual(5.0, 500.0)] = None
    """Maximum of pictures per second; the monitor's refresh rate by default."""

    keys: Annotated[tuple[Key, ...], Once()] = ()
    """Keys whose state is sent while the window has the focus, for the input ``keyboard``: letters,
    digits, ``arrow_left``, ``space``, ``lshift`` ..."""

    supervisor: SupervisorSettings | None = None
    """Sends the cameras' pictures to the experimenter's page: ``{}`` for all, none by default."""

    patch: PatchSettings | None = None
    """Square for a photodiode; none by default."""

    gaze_markers: GazeMarkerSettings | None = None
    """Squares in the corners for a head-mounted eye tracker; ``{}`` for the usual ones, none by
    default."""

    areas: Annotated[tuple[SceneObject, ...], Once()] = ("tip", "target", "other", "sphere")
    """Objects whose bounding boxes are recorded for eye tracking: tip, targets, shapes of cues;
    links, the grapple and things by name. Boxes follow the drawn objects."""

    quality: Literal["low", "medium", "high", "auto"] = "medium"
    """``low`` draws no shadows, ``medium`` hard shadows, ``high`` soft shadows and smooth edges
    (four samples per pixel). ``auto`` measures when the window opens, and uses the best quality
    that allows 40 pictures a second, or ``low``; the record states which."""

    shadow: Annotated[NonNegativeInt, Field(le=8192)] | None = None
    """Edge of the shadow maps in pixels; 0 for no shadows. ``quality`` sets the default."""

    display: Literal["window", "hidden"] = "window"
    """``hidden`` draws without a screen, for recordings and tests."""

    renderer: Literal["auto", "software"] = "auto"
    """``software`` draws without a graphics driver, and without shadows."""

    @model_validator(mode="after")
    def _screens_and_text_fit(self) -> "ViewSettings":
        if self.screens and self.screen is not None:
            raise WrongKey("screen and screens cannot be combined; drop one", at=("screen",))
        if self.screens and self.beside:
            raise WrongKey(
                "screens shows one wide picture, and beside asks for several; leave one out",
                at=("beside",),
            )
        if self.text_arcmin is not None and self.viewing_m is None:
            raise WrongKey(
                "text_arcmin needs viewing_m, the distance from the eye to the screen; write it",
                at=("text_arcmin",),
            )
        markers, monitors = self.gaze_markers, max(1, len(self.all_screens))
        if markers and markers.first + 4 * monitors > GAZE_MARKER_CODES:
            raise WrongKey(
                f"first is {markers.first}, and four markers on each of {monitors} monitors go "
                f"beyond the last, {GAZE_MARKER_CODES - 1}; "
                + (
                    f"write {GAZE_MARKER_CODES - 4 * monitors} or less"
                    if 4 * monitors <= GAZE_MARKER_CODES
                    else "leave gaze_markers out, or fill four monitors at most"
                ),
                at=("gaze_markers", "first"),
            )
        return self

    @property
    def all_screens(self) -> tuple[int | str, ...]:
        """The monitors that it fills, from left to right."""
        return self.screens if self.screen is None else (self.screen,)

    def provides(self, machine: Machine) -> Names:
        return {
            "camera": [camera.name for camera in self.cameras],
            "object": ("tip",),
            "key": KEYS,
            "screen": [str(screen) for screen in self.all_screens],
            "key of that view": self.keys,
            "audience": [self.seen_by],
        }

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        names = [camera.name for camera in self.cameras]
        found = self._told_to_everybody()
        if twice := [name for at, name in enumerate(names) if name in names[:at]]:
            found["beside"] = (
                f"has a second camera called {twice[0]!r}, so that their areas of interest and "
                "their pictures on the experimenter's page would share a name"
            )
        if max(self.size) > MOST_PIXELS:
            found["size"] = f"is {self.size[0]} by {self.size[1]} pixels, more than any screen has"
        if self.patch is not None and self.patch.size > min(self.size):
            found["patch.size"] = (
                f"is {self.patch.size} pixels, but the window has only {min(self.size)}"
            )
        if self.gaze_markers is not None and 2 * self.gaze_markers.size > min(self.size):
            found["gaze_markers.size"] = (
                f"is {self.gaze_markers.size} pixels: two need more than the window's "
                f"{min(self.size)}"
            )
        return found

    def _told_to_everybody(self) -> dict[str, str]:
        """Return the settings that show the operator error or success in every group."""
        others = self.seen_by == "examiner"
        if others and (self.all_screens or self.display == "hidden"):
            return {}
        found = {}
        if "distance" in self.hud_lines:
            found["hud"] = (
                "has distance, but the window has no screen of its own: with one monitor, the "
                "operator sees the task's error in every group; give the experimenter's monitor, "
                "as screen: 0, or leave distance out of hud"
                if others
                else "has distance, which shows the operator the task's error in every group, even "
                "without feedback; leave it out, make it feedback of a group, or write "
                "seen_by: examiner if the operator does not see this view"
            )
        if self.patch is not None and (told := [e for e in self.patch.on if e in ENTERING]):
            found["patch"] = (
                f"changes on {told[0]}, which shows the operator, in every group, when the target "
                "is reached; cover the patch with the photodiode, or let it change on other events"
            )
        return found

    @property
    def cameras(self) -> tuple[CameraSettings, ...]:
        """The first camera, and those beside it."""
        return (self.camera, *self.beside)

    @property
    def hud_lines(self) -> tuple[HudLine, ...]:
        """The lines of text that are shown."""
        if self.hud is not None:
            return self.hud
        return ("block", "trial", "distance") if self.seen_by == "examiner" else ("block", "trial")
