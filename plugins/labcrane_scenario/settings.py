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
    """Errors of a simulated operator, sampled with the seeds of participant and trial."""

    bumps_per_min: Annotated[NonNegativeFloat, Usual(0.001, 100.0)] = 0.0
    """Collisions per minute of movement: the operator lets the arm sink."""

    bump_s: PositiveFloat = 1.0
    """Duration of the sinking, in seconds."""

    bump_m_s: PositiveFloat = 0.15
    """Speed at which the tip sinks then, in m/s."""

    over_grip: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability, once for each grip, that the operator keeps pressing after the grip has
    formed."""

    over_grip_s: PositiveFloat = 3.0
    """Time in seconds for which the operator keeps pressing then."""

    misses: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability, for each trial, of overlooking a deformity."""

    false_reports: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability, for each trial without a deformity, of reporting one at the first goal."""


class PanelOperatorSettings(Settings):
    """A simulated operator at a control panel. Its values are assumed, not measured."""

    person = False

    gain_per_s: PositiveFloat = 1.2
    """Tip speed per distance from the goal, in 1/s."""

    speed_m_s: PositiveFloat = 0.25
    """Largest commanded tip speed, in m/s."""

    reaction_s: NonNegativeFloat = 0.4
    """Time from a new goal to the first movement, in seconds."""

    jaws: JointName = "jaws"
    """The joint that opens the jaws."""

    signal: float = Field(default=0.5, gt=0.0, le=1.0)
    """Proportion of the full signal with which the jaws are moved."""

    axes: dict[JointName, InputAxis] = Field(default={})
    """Axes of the input that the operator replaces, by the joint that each moves (``{jaws:
    -right.x}``), with a minus if the scheme has one. A joint that is not listed has the axis
    ``valve.<joint>``."""

    button: ButtonName | None = None
    """Button of the replaced input (``float.base`` of a panel), with which the operator reports a
    deformity when it sees one."""

    sees_m: PositiveFloat = 0.5
    """Distance in metres from the tip within which the operator sees a deformity."""

    errs: ErrorSettings | None = None
    """Errors of the operator, to rehearse counts and stop rules; none by default."""

    def provides(self, machine: Machine) -> Names:
        button = [self.button] if self.button else []
        return {"axis": [*self.axes_of(machine), "panel.connected", *button], "button": button}

    def axes_of(self, machine: Machine) -> list[str]:
        """Return the name of the axis that moves each joint."""
        return [self.axes.get(name, f"valve.{name}").lstrip("-") for name in machine.names]

    def needs(self, machine: Machine) -> Names:
        return {"joint": [self.jaws]}
