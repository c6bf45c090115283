"""Settings of cranes: how their drives follow, and what hangs on the tip."""

import math
from collections.abc import Mapping

from pydantic import Field, NonNegativeFloat, PositiveFloat

from labcrane.core.settings import Names, Settings
from labcrane.machines.actuator import ACTUATOR_PRESETS, ActuatorSettings
from labcrane.machines.machine import GRAVITY, Machine

LONGEST_LAG_S = 5.0


class CraneSettings(Settings):
    """How the crane follows its commands."""

    actuator: ActuatorSettings = ACTUATOR_PRESETS["ideal"]
    """Delay between command and motion: ideal, electric, hydraulic, sluggish, or written out."""

    def provides(self, machine: Machine) -> Names:
        return {"object": (), "scene": ()}

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        drive = self.actuator
        late = drive.dead_time_s + drive.lag_s
        if late <= LONGEST_LAG_S:
            return {}
        return {"actuator": f"follows {late:g} s late: such a crane cannot be steered"}


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
        hanging = ("grapple", "grapple rod") if self.grapple else ()
        return {"object": hanging, "scene": ()}

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        found = dict(super().doubts(machine))
        reach = sum(math.hypot(joint.a, joint.d) for joint in machine.joints)
        strongest = max(joint.effort for joint in machine.joints)
        if self.grapple and self.grapple.length_m > reach:
            found["grapple.length_m"] = (
                f"is {self.grapple.length_m:g} m, but the crane itself reaches only {reach:.3g} m"
            )
        if self.hanging_kg * GRAVITY * reach / 2 > strongest:
            found["payload_kg"] = (
                f"is {self.payload_kg:g} kg; with it the hanging load needs "
                f"{self.hanging_kg * GRAVITY * reach / 2:.3g} N m at half of the reach, but the "
                f"strongest joint has {strongest:.3g}"
            )
        return found

    @property
    def loaded(self) -> bool:
        """Whether anything hangs on the crane."""
        return self.grapple is not None or self.payload_kg > 0.0

    @property
    def hanging_kg(self) -> float:
        """Mass of grapple and payload, in kg."""
        return self.payload_kg + (self.grapple.mass_kg if self.grapple else 0.0)
