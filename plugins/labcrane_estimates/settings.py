"""Settings of the estimates."""

from typing import Annotated, ClassVar

from pydantic import Field, PositiveFloat, model_validator

from labcrane.core import EstimateSettings, WrongKey

Channels = Annotated[tuple[str, ...], Field(min_length=1)]
Band = tuple[PositiveFloat, PositiveFloat]


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
