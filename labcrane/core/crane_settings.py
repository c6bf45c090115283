"""Settings of cranes: how their drives follow, and what hangs on the tip."""

from pydantic import Field, NonNegativeFloat, PositiveFloat

from labcrane.core.settings import Names, Settings
from labcrane.machines.actuator import ACTUATOR_PRESETS, ActuatorSettings
from labcrane.machines.machine import Machine


class CraneSettings(Settings):
    """How the crane follows its commands."""

    actuator: ActuatorSettings = ACTUATOR_PRESETS["ideal"]
    """Delay between command and motion: ideal, electric, hydraulic, sluggish, or written out."""

    def provides(self, machine: Machine) -> Names:
        return {"object": ()}


class GrappleSettings(Settings):
    """A grapple that hangs from the tip and swings in all directions."""

    mass_kg: PositiveFloat = 150.0
    """Its own mass, in kilograms."""

    length_m: PositiveFloat = 1.0
    """From the tip to its centre of mass, in metres."""

    size_m: PositiveFloat = 0.5
    """Edge of the cube that its inertia and its looks are those of, in metres."""

    damping: NonNegativeFloat = 30.0
    """Of either swing, in N m s/rad."""


class LoadedCraneSettings(CraneSettings):
    """How the crane follows its commands, and what hangs on it."""

    payload_kg: NonNegativeFloat = Field(default=0.0, le=1e5)
    """Mass at the tip, or in the grapple if there is one, in kilograms."""

    grapple: GrappleSettings | None = None
    """None by default. ``{}`` is one with the values above."""

    def provides(self, machine: Machine) -> Names:
        return {"object": ("grapple", "grapple rod") if self.grapple else ()}

    @property
    def loaded(self) -> bool:
        """Whether anything hangs on the crane."""
        return self.grapple is not None or self.payload_kg > 0.0

    @property
    def hanging_kg(self) -> float:
        """Mass of grapple and payload, in kg."""
        return self.payload_kg + (self.grapple.mass_kg if self.grapple else 0.0)
