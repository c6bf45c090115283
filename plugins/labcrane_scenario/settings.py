"""Settings of scenarios and of those who run them without a person."""

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from labcrane import Machine, Settings
from labcrane.core import ButtonName, JointName, Names, StudyPath

EVENTS = (
    "goal.reached", "mistakes.too_many", "deformity.found", "drop", "overload", "contact.object",
    "contact.body", "scene.placed",
)  # fmt: skip
"""What a run tells beside its beginning and end."""


class ScenarioSettings(Settings):
    """Settings of the scenario task."""

    scenes: tuple[StudyPath, ...] = Field(min_length=1)
    """Scene files, one run each; a scene's name is its file's. They are the levels of the factor
    ``scenes``."""

    mistakes: PositiveInt = 4
    """More mistakes than this of one kind end the run, with a completion flag of 0, unless the
    supervisor overrides it."""

    limit_s: PositiveFloat | None = None
    """Time after which a run ends, in seconds; each scene's own by default."""

    release: float = Field(default=0.8, gt=0.0, le=1.0)
    """A contact beyond its limit has ended when the force is below this share of the limit..."""

    hold_s: NonNegativeFloat = 0.2
    """... for this time, in seconds. Until then it is one mistake."""

    find_axis: ButtonName | None = None
    """Button with which the operator reports a deformity, while the tip is near it; none by
    default. The supervisor reports one with a note that begins with "found"."""

    find_m: PositiveFloat = 0.5
    """How near the tip must be then to the middle of the limb, in metres."""

    def provides(self, machine: Machine) -> Names:
        from labcrane.machines import load_scene  # noqa: PLC0415 - loads numpy

        scenes = [load_scene(path) for path in self.scenes]
        things = {thing for scene in scenes for thing in scene.things}
        figure = ("figure",) if any(scene.figure for scene in scenes) else ()
        return {"object": ["target", *sorted(things), *figure], "event": EVENTS}


class OperatorSettings(Settings):
    """A simulated operator at a control panel. Its values are ours, and never a result."""

    gain_per_s: PositiveFloat = 1.2
    """Tip speed per distance from the goal, in 1/s."""

    speed_m_s: PositiveFloat = 0.25
    """Largest tip speed asked for, in m/s."""

    reaction_s: NonNegativeFloat = 0.4
    """Time from a new goal to the first movement, in seconds."""

    jaws: JointName = "jaws"
    """The joint that opens the jaws."""

    signal: float = Field(default=0.5, gt=0.0, le=1.0)
    """Share of full signal with which the jaws are moved."""

    def provides(self, machine: Machine) -> Names:
        return {"axis": [*(f"valve.{name}" for name in machine.names), "panel.connected"]}

    def needs(self, machine: Machine) -> Names:
        return {"joint": [self.jaws]}
