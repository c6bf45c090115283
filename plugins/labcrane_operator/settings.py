"""Settings of simulated operators. Every default is invented, none is fitted to people."""

from pathlib import Path
from typing import Annotated

from pydantic import (
    AfterValidator,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
    model_validator,
)

from labcrane import Machine, Settings
from labcrane.core import ButtonName, InputAxis, Names, Once, SignalName, Usual, WrongKey

CONNECTED = "operator.connected"
"""Axis that reports that the operator is connected, if it has no joysticks."""

STICK = ("x", "y", "twist", "slider", "trigger", "connected")


def _have_no_sign(axes: tuple[str, ...]) -> tuple[str, ...]:
    if turned := [axis for axis in axes if axis.startswith("-")]:
        raise ValueError(
            f"{turned[0]!r} is reversed, but only a scheme's map can reverse an axis; write "
            f"{turned[0][1:]}"
        )
    return axes


Axes = Annotated[tuple[InputAxis, ...], AfterValidator(_have_no_sign), Once()]
"""Axes of the input, as they are."""


class ResponseSettings(Settings):
    """How the operator responds to the stimuli of a secondary task, and what that costs."""

    to: SignalName
    """The stimulus: ``drt.stimulus``."""

    button: InputAxis = "left.trigger"
    """Axis of the input that the operator presses."""

    median_s: PositiveFloat = 0.4
    """Median response time with the hands at rest, in seconds."""

    sd: NonNegativeFloat = 0.25
    """Standard deviation of the logarithm of the response time."""

    lapse_rate: float = Field(default=0.03, ge=0.0, le=1.0)
    """Probability that a stimulus is not noticed with the hands at rest."""

    load: NonNegativeFloat = 1.0
    """How much longer the response takes, and how much more often a stimulus is not noticed, with
    the hands fully deflected, as a fraction."""

    press_s: PositiveFloat = 0.1
    """How long the button is pressed, in seconds."""


class OperatorSettings(Settings):
    """A person who sees a target, aims, and corrects until the tip rests in it.

    The values are assumed: plausible for a rate-controlled crane, but not measured. They show that
    a study runs, not how people behave.
    """

    person = False

    reaction_s: PositiveFloat = 0.35
    """Median time from seeing a target to the first movement, in seconds."""

    reaction_sd: NonNegativeFloat = 0.2
    """Standard deviation of the logarithm of the reaction time."""

    lapse_rate: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that the operator looks elsewhere when a trial's target appears."""

    lapse_s: PositiveFloat = 2.0
    """Delay of the movement after a lapse, in seconds."""

    fitts_a_s: NonNegativeFloat = 1.0
    """Intercept of Fitts' law for one sub-movement, in seconds."""

    fitts_b_s: PositiveFloat = 2.5
    """Slope of Fitts' law, in seconds per bit of log2(distance / width + 1)."""

    learning_gain: NonNegativeFloat = 0.5
    """Additional time of a session's first movement, as a fraction of a practised movement."""

    learning_rate: NonNegativeFloat = 0.1
    """Rate, per trial, at which this additional time decays: with exp(-rate · trials)."""

    pace_sd: Annotated[NonNegativeFloat, Usual(0.001, 3.0)] = 0.0
    """Standard deviation, over participants, of the logarithm of their durations; sampled with the
    participant's seed."""

    endpoint_noise: NonNegativeFloat = 0.04
    """Standard deviation of a sub-movement's end point along its direction, as a fraction of its
    length; half as much to the sides."""

    motor_noise: NonNegativeFloat = 0.05
    """Standard deviation of the hands' speed along each axis, as a fraction of that speed."""

    motor_noise_s: PositiveFloat = 0.2
    """Correlation time of the motor noise, in seconds."""

    gain_per_s: PositiveFloat = 1.5
    """Speed of the correction per distance from the planned path, in 1/s."""

    look_s: PositiveFloat = 0.25
    """Time from the end of a sub-movement until the operator has seen its outcome, in seconds."""

    inside: float = Field(default=0.8, gt=0.0, le=1.0)
    """Distance from the target's centre that the operator treats as inside, as a fraction of its
    radius."""

    axes: Axes = ()
    """Axes of the input that the operator replaces, if these are not two joysticks:
    ``[keyboard.slew, keyboard.boom]``. The default is the axes of two joysticks."""

    button: ButtonName | None = None
    """The button that the operator presses, if ``axes`` is given; none by default."""

    response: ResponseSettings | None = None
    """How the operator responds to a secondary task; null: not at all."""

    @model_validator(mode="after")
    def _button_is_beside_axes(self) -> "OperatorSettings":
        if self.button is not None and not self.axes:
            raise WrongKey(
                "button is given without axes, and two joysticks have their triggers; name axes "
                "as well, or leave button out",
                at=("button",),
            )
        return self

    def provides(self, machine: Machine) -> Names:
        if self.axes:
            button = [self.button] if self.button else []
            return {"axis": [*self.axes, *button, CONNECTED], "button": button}
        sides = ("left", "right")
        return {
            "axis": [f"{side}.{part}" for side in sides for part in STICK],
            "button": [f"{side}.trigger" for side in sides],
        }


class TowardSettings(Settings):
    """Hands that take the tip straight to the target: the nearer, the slower, and never past it."""

    person = False

    gain_per_s: Annotated[PositiveFloat, Usual(0.1, 10.0)] = 1.5
    """Speed of the tip per distance from the target, in 1/s, as far as the scheme allows."""

    axes: Axes = ("left.x", "left.y", "right.x", "right.y")
    """Axes of the input that the scheme uses. The default is the axes of two joysticks."""

    def provides(self, machine: Machine) -> Names:
        return {"axis": self.axes, "button": self.axes}

    def needs(self, machine: Machine) -> Names:
        return {"signal": ["target.position.x"]}


class RecordedSettings(Settings):
    """Settings of :class:`RecordedInput`."""

    person = False

    file: Path
    """A participant file; a relative path counts from the folder in which labcrane runs."""

    session: PositiveInt = 1
    """Which session of it."""
