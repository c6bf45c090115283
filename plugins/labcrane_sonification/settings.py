"""Settings of the tone."""

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import (
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
    ValidationInfo,
    field_validator,
    model_validator,
)

from labcrane import Machine, Settings
from labcrane.core import ByEstimate, Names, SignalName, Unit, Within, WrongKey, was_run

MOST_OVERTONES = 15
LOWEST_HZ, HIGHEST_HZ = 40.0, 10_000.0
"""Range of fundamentals in which adults hear a sine from any loudspeaker."""

FULL_SCALE = 1.0
"""Largest amplitude that a sound device plays; a larger one is clipped, and heard as noise."""

ROUNDING = 1e-9

FEWEST_SAMPLES, MOST_SAMPLES = 8000, 192_000


def sum_of_partials(overtones: int) -> float:
    """Return the sum of the amplitudes of fundamental and overtones, with a fundamental of 1."""
    return sum(1.0 / number for number in range(1, 2 + overtones))


class SonificationSettings(Settings):
    """How the tone follows the movement, and how it is played.

    The published study reports sinusoids whose overtones follow the distance, but no formulas. The
    defaults are our proposal: logarithmic pitch over two octaves, rising as the tip approaches.
    """

    far: Annotated[PositiveFloat, Unit("m")] = 4.0
    """Distance between tip and target, in metres, beyond which the tone no longer changes."""

    pitch_hz: tuple[PositiveFloat, PositiveFloat] = (220.0, 880.0)
    """Fundamental far away and at the target, in hertz; equal steps of distance are equal musical
    intervals. Swap the values to reverse the polarity."""

    overtones: tuple[int, int] = (0, 5)
    """Overtones above the fundamental far away and at the target, 0 to 15."""

    level: tuple[float, float] = (0.3, 0.3)
    """Amplitude of the fundamental far away and at the target, 0 to 1, before ``weighting``.
    Overtones add 1/2, 1/3 and so on of it; the sum must not exceed 1."""

    weighting: Literal["a", "none"] = "a"
    """``a`` lowers the amplitude at pitches to which the ear is more sensitive, so that the same
    ``level`` is equally loud at every distance, in dB(A); ``none`` keeps the amplitude."""

    loudness: Annotated[float, Field(ge=0.0, le=1.0)] | ByEstimate = 1.0
    """Factor of ``level``, 0 to 1. Or one that follows an estimate."""

    aside: Annotated[PositiveFloat, Unit("m")] = 2.0
    """Lateral distance, in metres, at which the tone comes from one side only."""

    pan: Literal["towards", "away", "none"] = "towards"
    """Whether the tone comes from the side of the target, seen from the tip, or from the opposite
    side."""

    silent_after_s: NonNegativeFloat | None = 0.3
    """Seconds inside the target after which the tone falls silent; null keeps it sounding."""

    stimulus: SignalName | None = None
    """Stimulus of a secondary task, such as ``drt.stimulus``: the tone sounds while it is on, as
    it sounds at the target, and does not follow the movement."""

    ramp_s: NonNegativeFloat = 0.015
    """Duration of a change, in seconds; shorter changes click."""

    block: PositiveInt = Field(default=256, ge=16, le=8192)
    """Samples per block; a change becomes audible with the next block."""

    rate_hz: PositiveInt = 48000
    """Samples per second."""

    driver: Literal["portaudio", "jack"] = "portaudio"
    """Sound system that plays the tone."""

    device: int | None = None
    """PortAudio's number of the output device; the system's default device by default."""

    @field_validator("device")
    @classmethod
    def _is_counted(cls, device: int | None, info: ValidationInfo) -> int | None:
        if device is not None and device < 0 and not was_run(info):
            raise ValueError(
                f"it is {device}, and devices are counted from 0; leave it out for the system's "
                "default"
            )
        return device

    def reveals(self) -> tuple[str | Within, ...]:
        if not any(self.level) or self.stimulus:
            return ()
        told: list[str | Within] = []
        if not self._is_constant:
            told.append(Within("how far the tip is from the target", self.far))
        if self.pan != "none":
            told.append("on which side the target is")
        if self.silent_after_s is not None:
            told.append("whether the tip is inside the target")
        return tuple(told)

    def provides(self, machine: Machine) -> Names:
        return {"object": ()}

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        found = {}
        few, many = min(self.pitch_hz), max(self.pitch_hz)
        highest = many * (1 + max(self.overtones))
        if few < LOWEST_HZ or many > HIGHEST_HZ:
            found["pitch_hz"] = f"is {few:g} to {many:g} Hz, which not everybody hears"
        elif self._is_constant and not self.stimulus:
            found["pitch_hz"] = (
                f"is {few:g} Hz at every distance, and overtones and level do not change, so that "
                "nothing is heard of it"
            )
        elif highest > self.rate_hz / 2:
            found["overtones"] = (
                f"reach {highest:g} Hz, and {self.rate_hz} samples a second hold half their "
                "number, so that others are heard instead"
            )
        if not any(self.level):
            found["level"] = "is 0 at every distance: nothing is heard"
        if not FEWEST_SAMPLES <= self.rate_hz <= MOST_SAMPLES:
            found["rate_hz"] = f"is {self.rate_hz}, which few sound cards play"
        return found

    @property
    def _is_constant(self) -> bool:
        return all(far == near for far, near in (self.pitch_hz, self.overtones, self.level))

    @model_validator(mode="after")
    def _levels_and_overtones_are_possible(self) -> "SonificationSettings":
        if not all(0.0 <= level <= 1.0 for level in self.level):
            raise WrongKey(
                f"level must be 0 to 1, but is {self.level[0]:g}, {self.level[1]:g}", at=("level",)
            )
        if not all(0 <= count <= MOST_OVERTONES for count in self.overtones):
            few, many = self.overtones
            raise WrongKey(
                f"overtones must be 0 to {MOST_OVERTONES}, but are {few}, {many}", at=("overtones",)
            )
        return self

    @model_validator(mode="after")
    def _is_not_cut_off(self, info: ValidationInfo) -> "SonificationSettings":
        if was_run(info) or max(self.level) * sum_of_partials(max(self.overtones)) <= FULL_SCALE:
            return self
        from labcrane_sonification.tone import loudest  # noqa: PLC0415 - it loads numpy

        amplitude, distance = loudest(self)
        if amplitude > FULL_SCALE + ROUNDING:
            possible = [math.floor(100 * each / amplitude) / 100 for each in self.level]
            raise WrongKey(
                f"level is {self.level[0]:g}, {self.level[1]:g}, and the fundamental and its "
                f"overtones add up to {amplitude:.4g} at {distance:.3g} m from the target, where "
                f"{FULL_SCALE:g} is all that can be played and the rest is cut off; write level: "
                f"[{possible[0]:g}, {possible[1]:g}], or fewer overtones",
                at=("level",),
            )
        return self
