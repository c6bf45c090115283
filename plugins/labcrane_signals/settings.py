"""Settings of the monitors of signals."""

from typing import Literal

from pydantic import PositiveFloat

from labcrane import Machine, Settings
from labcrane.core import CONFIDENCE, Names


class ElectrodeSettings(Settings):
    """Expected properties of electrode signals."""

    mains_hz: Literal[50, 60] | None = None
    """Mains frequency where the study runs, in Hz; without a value, both are monitored."""

    hum_uv: PositiveFloat = 10.0
    """Mains hum from which it is reported, in microvolts, root mean square."""


class EegSettings(ElectrodeSettings):
    """Whether each electrode of an EEG is alive: flat, railing, hum, disconnected, bridged."""

    def provides(self, machine: Machine) -> Names:
        return {"stream type": ("EEG",)}


class EcgSettings(ElectrodeSettings):
    """Whether an ECG is alive: flat, railing, hum, disconnected."""

    hum_uv: PositiveFloat = 50.0
    """Mains hum from which it is reported, in microvolts, root mean square."""


class EmgSettings(ElectrodeSettings):
    """Whether an EMG is alive: flat, railing, hum."""

    hum_uv: PositiveFloat = 20.0
    """Mains hum from which it is reported, in microvolts, root mean square."""


class GazeSettings(Settings):
    """Whether an eye tracker sees the eyes: gaze lost, pupil implausible, wrong unit."""

    def provides(self, machine: Machine) -> Names:
        return {"stream type": ("Gaze",)}

    confidence: PositiveFloat = CONFIDENCE
    """Confidence, 0 to 1, below which a sample does not count as gaze, neither here nor in the
    measures."""


class StickSettings(Settings):
    """Whether the axes of sticks, streamed by another program, are alive."""


class ForceSettings(Settings):
    """Whether a force sensor is alive: flat, railing, beyond what it can measure."""

    largest: PositiveFloat | None = None
    """Largest force that the sensor measures, in the unit of its stream; without a value, the range
    is not checked."""


class AnySettings(Settings):
    """Whether any regular stream of numbers is alive: flat, railing, no values."""
