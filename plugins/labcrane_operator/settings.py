"""Settings of simulated operators. Every default is invented, none is fitted to people."""

from pathlib import Path

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from labcrane import Machine, Settings
from labcrane.core import Names

STICK = ("x", "y", "twist", "slider", "trigger", "connected")


class OperatorSettings(Settings):
    """A person who sees a target, aims, and corrects until the tip rests in it.

    The values are ours: plausible for a rate-controlled crane, and never a result. They show
    that a study runs, not how people behave.
    """

    reaction_s: PositiveFloat = 0.35
    """Median time from seeing a target to the first movement, in seconds."""

    reaction_sd: NonNegativeFloat = 0.2
    """Standard deviation of the logarithm of the reaction time."""

    lapse_rate: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that the eyes are elsewhere when a trial's target appears."""

    lapse_s: PositiveFloat = 2.0
    """How much later the movement then begins, in seconds."""

    fitts_a_s: NonNegativeFloat = 1.0
    """Intercept of Fitts' law for one sub-movement, in seconds."""

    fitts_b_s: PositiveFloat = 2.5
    """Slope of Fitts' law, in seconds per bit of log2(distance / width + 1)."""

    learning_gain: NonNegativeFloat = 0.5
    """How much longer the first movement of a session takes, as a fraction of a practised one."""

    learning_rate: NonNegativeFloat = 0.1
    """How fast that wears off, per trial: the gain falls with exp(-rate · trials)."""

    pace_sd: NonNegativeFloat = 0.0
    """Standard deviation over participants of the logarithm of their durations; drawn from the
    participant's seed."""

    endpoint_noise: NonNegativeFloat = 0.04
    """Standard deviation of where a sub-movement ends, along its direction, as a fraction of its
    length; half of it to the sides."""

    motor_noise: NonNegativeFloat = 0.05
    """Standard deviation of the hands' speed along each axis, as a fraction of that speed."""

    motor_noise_s: PositiveFloat = 0.2
    """Correlation time of the motor noise, in seconds."""

    gain_per_s: PositiveFloat = 1.5
    """Tip speed per distance from the planned path with which it is corrected, in 1/s."""

    patience_m: PositiveFloat = 0.6
    """Distance of the tip behind the plan, in metres, at which the plan waits for the machine;
    from half of it on, it goes slower."""

    look_s: PositiveFloat = 0.25
    """Time from the end of a sub-movement until its outcome has been seen, in seconds."""

    inside: float = Field(default=0.8, gt=0.0, le=1.0)
    """Distance from the target's centre that is taken for inside, as a fraction of its radius."""

    still_m_s: PositiveFloat = 0.015
    """Tip speed that is taken for rest, in m/s; also the smallest speed that is steered."""

    press_s: PositiveFloat = 0.1
    """How long the trigger of the right stick is pressed at rest inside the target, in seconds."""

    def provides(self, machine: Machine) -> Names:
        sides = ("left", "right")
        return {
            "axis": [f"{side}.{part}" for side in sides for part in STICK],
            "button": [f"{side}.trigger" for side in sides],
        }


class RecordedSettings(Settings):
    """Settings of :class:`RecordedInput`."""

    file: Path
    """A participant file; a relative path counts from the folder in which labcrane runs."""

    session: PositiveInt = 1
    """Which session of it."""
