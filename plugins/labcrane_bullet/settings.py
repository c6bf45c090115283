"""What a protocol can set of either crane."""

from labcrane import PRESETS, ActuatorSettings, Settings


class CraneSettings(Settings):
    """How the crane follows its commands."""

    actuator: ActuatorSettings = PRESETS["ideal"]
    """Delay between command and motion: ideal, electric, hydraulic, sluggish, or written out."""
