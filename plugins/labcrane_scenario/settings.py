"""Settings of scenarios and of those who run them without a person."""

from typing import Annotated

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from labcrane import Machine, Settings
from labcrane.core import ButtonName, InputAxis, JointName, Names, SceneFile, Usual

EVENTS = (
    "goal.reached", "mistakes.too_many", "deformity.reported", "deformity.found", "drop",
    "overload", "contact.object", "contact.body", "scene.placed",
)  # fmt: skip
"""Events of a run other than its beginning and end."""


class ScenarioSettings(Settings):
    """Settings of the scenario task."""

    scenes: tuple[SceneFile, ...] = Field(min_length=1)
    """Scene files, one run each; a scene has the name of its file. The scenes are the levels of the
    factor ``scenes``."""

    mistakes: PositiveInt = 4
    """More mistakes than this of one kind end the run with a completion flag of 0, unless the
    experimenter overrides it. Drops are counted separately and do not end the run: the paper's
    indicator does not include them."""

    limit_s: Annotated[PositiveFloat | None, Usual(5.0, 4 * 3600.0)] = None
    """Time after which a run ends, in seconds; each scene's own by default."""

    release: float = Field(default=0.8, gt=0.0, le=1.0)
    """A contact beyond its limit has ended when the force is below this share of the limit..."""

    hold_s: NonNegativeFloat = 0.2
    """... for this time, in seconds. Until then it is one mistake."""

    drop_m: Annotated[NonNegativeFloat, Usual(0.001, 5.0)] = 0.15
    """Height in metres above which something that is let go counts as dropped, once it has left the
    jaws. Something that slips out of the jaws is a drop if nothing supports it. For a casualty, the
    limb in the jaws counts."""

    find_axis: ButtonName | None = None
    """Button with which the operator reports a deformity, while the tip is near it; none by
    default. It counts when it is pressed, not while it is held. Both pages have a button, too. The
    participant's counts like this one. The experimenter's, or a note that begins with "found",
    counts wherever the tip is. If there is no deformity, or the tip is not near it, the report is
    false and counted as such."""

    find_m: PositiveFloat = 0.5
    """Distance in metres from the middle of the limb within which the tip must be for a report."""

    def provides(self, machine: Machine) -> Names:
        from labcrane.machines import load_scene  # noqa: PLC0415 - loads numpy

        scenes = [load_scene(path) for path in self.scenes]
        things = {thing for scene in scenes for thing in scene.things}
        figure = ("figure",) if any(scene.figure for scene in scenes) else ()
        return {"object": ["target", *sorted(things), *figure], "event": EVENTS}


class ErrorSettings(Settings):
    """How a simulated operator errs. All is drawn from the participant's and the trial's seed."""

    bumps_per_min: Annotated[NonNegativeFloat, Usual(0.001, 100.0)] = 0.0
    """How often it bumps into something, in a minute of movement: it lets the arm sink."""

    bump_s: PositiveFloat = 1.0
    """For how long it does so then, in seconds."""

    bump_m_s: PositiveFloat = 0.15
    """How fast the tip sinks then, in m/s."""

    over_grip: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability of pressing on after a grip has formed, once for each grip."""

    over_grip_s: PositiveFloat = 3.0
    """For how long it presses on then, in seconds."""

    misses: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability of overlooking a deformity, in a trial."""

    false_reports: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability of reporting one where there is none, in a trial: at its first goal."""

    fatigue_per_min: Annotated[NonNegativeFloat, Usual(1e-5, 1.0)] = 0.0
    """Share of its speed that is lost in a minute of the session, and by which it errs more often:
    after t minutes it has exp(-fatigue t) of its speed, and 1 / that of its rates."""


class PanelOperatorSettings(Settings):
    """A simulated operator at a control panel. Its values are ours, and never a result."""

    gain_per_s: PositiveFloat = 1.2
    """Tip speed per distance from the goal, in 1/s."""

    speed_m_s: PositiveFloat = 0.25
    """Largest tip speed asked for, in m/s."""

    touch_m_s: PositiveFloat = 0.03
    """Largest tip speed where something is to be touched, in m/s."""

    reaction_s: NonNegativeFloat = 0.4
    """Time from a new goal to the first movement, in seconds."""

    jaws: JointName = "jaws"
    """The joint that opens the jaws."""

    signal: float = Field(default=0.5, gt=0.0, le=1.0)
    """Share of full signal with which the jaws are moved."""

    axes: dict[JointName, InputAxis] = Field(default={})
    """Axes of the input that it stands for, by the joint that each moves (``{jaws: -right.x}``),
    with a minus where the scheme has one. A joint left out has its own axis: ``valve.jaws``."""

    button: ButtonName | None = None
    """A button of the input that it has too, like the device it stands for (``float.base`` of a
    panel), with which it reports a deformity once it sees one."""

    sees_m: PositiveFloat = 0.5
    """How near the tip must come to a deformity for it to be seen, in metres."""

    errs: ErrorSettings | None = None
    """How it errs, so that counts and stop rules can be rehearsed; never, by default."""

    def provides(self, machine: Machine) -> Names:
        button = [self.button] if self.button else []
        return {"axis": [*self.axes_of(machine), "panel.connected", *button], "button": button}

    def axes_of(self, machine: Machine) -> list[str]:
        """Return the name of the axis that moves each joint."""
        return [self.axes.get(name, f"valve.{name}").lstrip("-") for name in machine.names]

    def needs(self, machine: Machine) -> Names:
        return {"joint": [self.jaws]}
