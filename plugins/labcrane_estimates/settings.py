"""Settings of the estimates."""

from typing import Annotated, ClassVar

from pydantic import Field, FiniteFloat, PositiveFloat, model_validator

from labcrane.core import EstimateSettings, WrongKey

Channels = Annotated[tuple[str, ...], Field(min_length=1)]
Band = tuple[PositiveFloat, PositiveFloat]
Range = tuple[FiniteFloat, FiniteFloat]


class BandPowerSettings(EstimateSettings):
    """The power of one band over that of another: theta at Fz over alpha at Pz, for load."""

    values: ClassVar[tuple[str, ...]] = ("ratio",)

    channels: Channels
    """Labels of the channels whose mean power is divided."""

    band_hz: Band = (4.0, 8.0)
    """Their band, in Hz."""

    per_channels: Channels
    """Labels of the channels by whose mean power it is divided."""

    per_band_hz: Band = (8.0, 13.0)
    """Their band, in Hz."""

    window_s: PositiveFloat = 2.0
    """Time from which the powers are computed, in seconds; spectra are of 1 s (Welch)."""

    @model_validator(mode="after")
    def _rise(self) -> "BandPowerSettings":
        for key in ("band_hz", "per_band_hz"):
            low, high = getattr(self, key)
            if high - low < 1.0:
                raise WrongKey(
                    f"{key} is {low:g} to {high:g} Hz, and a spectrum of 1 s resolves 1 Hz; give "
                    "the lower edge first, and 1 Hz more at least",
                    at=(key,),
                )
        if self.window_s < 1.0:
            raise WrongKey("a spectrum is of 1 s; give a window_s of 1 at least", at=("window_s",))
        return self


class HeartSettings(EstimateSettings):
    """Heart rate in 1/min, and RMSSD in ms, from the R peaks of an ECG."""

    values: ClassVar[tuple[str, ...]] = ("rate", "rmssd")

    channel: str
    """Label of the channel of the ECG."""

    window_s: Annotated[float, Field(ge=5.0)] = 30.0
    """Time from which both are computed, in seconds; three beats have to be in it."""


class SkinSettings(EstimateSettings):
    """Skin conductance responses per minute, from an EDA."""

    values: ClassVar[tuple[str, ...]] = ("rate",)

    channel: str
    """Label of the channel of the conductance."""

    window_s: Annotated[float, Field(ge=10.0)] = 60.0
    """Time over which responses are counted, in seconds; each has to rise and fall in it."""

    smallest: PositiveFloat = 0.05
    """Amplitude from which a rise is a response, in the channel's unit: 0.05 uS (Boucsein 2012)."""


class PupilSettings(EstimateSettings):
    """The change of the pupil's size against its baseline: 0.1 is 10 % larger."""

    values: ClassVar[tuple[str, ...]] = ("change",)

    channel: str
    """Label of the channel of the pupil's size; samples that are not above 0 are blinks."""

    window_s: PositiveFloat = 1.0
    """Time over which the size is averaged, in seconds."""

    baseline_s: PositiveFloat = 60.0
    """Time up to now over which the median is the baseline, in seconds."""


class GazeRegionSettings(EstimateSettings):
    """The share of the gaze in a rectangle of the screen, of the samples in which it was measured.

    The rectangle does not move with the picture: it knows no target.
    """

    values: ClassVar[tuple[str, ...]] = ("share",)

    channels: tuple[str, str]
    """Labels of the channels of the gaze's place: across, then up or down. What a tracker sends
    while it sees no eye has to be NaN or outside of the rectangle; some send 0 and 0."""

    between_x: Range
    """Edges of the rectangle across, in the unit of the channel: 0 to 1 for most eye trackers."""

    between_y: Range
    """Its edges up and down, in the unit of that channel."""

    window_s: PositiveFloat = 10.0
    """Time over which the share is taken, in seconds."""

    @model_validator(mode="after")
    def _rise(self) -> "GazeRegionSettings":
        for key in ("between_x", "between_y"):
            low, high = getattr(self, key)
            if not low < high:
                message = f"{key} is {low:g} to {high:g}; give the smaller edge first"
                raise WrongKey(message, at=(key,))
        return self


class StickActivitySettings(EstimateSettings):
    """How fast the sticks move, in full deflections per second, and for which share of the time.

    Its stream is the session's own: ``{name: labcrane.input}``.
    """

    values: ClassVar[tuple[str, ...]] = ("rms_speed", "moving")

    channels: Channels
    """Axes of the input, as ``left.x``; their squared speeds are added."""

    window_s: PositiveFloat = 10.0
    """Time over which both are computed, in seconds."""

    step_s: PositiveFloat = 0.05
    """Time between the two samples from which a speed is computed, in seconds: of a stick with 256
    positions, a step to the next one within it is 0.16 full deflections per second."""

    still: PositiveFloat = 0.2
    """Speed of an axis up to which it is at rest, in full deflections per second."""

    @model_validator(mode="after")
    def _steps(self) -> "StickActivitySettings":
        if self.step_s >= self.window_s:
            raise WrongKey("a step is as long as the window; give a shorter one", at=("step_s",))
        return self


class DrtResponseSettings(EstimateSettings):
    """The mean response time of a detection response task (``drt``), in seconds.

    Its stream is the session's own: ``{name: labcrane.codes}``. Times are those of
    the ticks, as in the result ``response_time`` of the task.
    """

    values: ClassVar[tuple[str, ...]] = ("response_time",)

    at_most_age_s: PositiveFloat = 10.0
    """Age from which a value is late, in seconds; the task has an event every 5 s at least."""

    window_s: PositiveFloat = 60.0
    """Time over which stimuli with a hit are averaged, in seconds."""

    hit_s: tuple[PositiveFloat, PositiveFloat] = (0.1, 2.5)
    """Shortest and longest response time of a hit, in seconds: ``hit_s`` of the task."""
