"""Settings of the sphere."""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from labcrane import Machine, Settings
from labcrane.core import Names, Unit, Within, WrongKey

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class SphereSettings(Settings):
    """Where the sphere is, and how it follows the distance.

    The published study names brightness and size, not their laws: these are a proposal.
    """

    at: Literal["target", "tip"] = "target"
    """Where it is drawn."""

    far: Annotated[PositiveFloat, Unit("m")] = 4.0
    """Distance of tip and target, in metres, from which on the sphere stays as it is."""

    law: Literal["linear", "log"] = "linear"
    """How it changes with distance; ``log`` changes most near the target."""

    polarity: Literal["shrinks", "grows"] = "shrinks"
    """What its size does as the tip comes closer."""

    brightness: Literal["brightens", "darkens", "constant"] = "brightens"
    """What its brightness does as the tip comes closer."""

    smallest: Annotated[PositiveFloat, Unit("m")] = 0.15
    """Smallest radius, in metres."""

    largest: Annotated[PositiveFloat, Unit("m")] = 0.60
    """Largest radius, in metres."""

    darkest: NonNegativeFloat = Field(default=0.25, lt=1.0)
    """Smallest brightness, 1 being the full colour."""

    colour: tuple[Share, Share, Share] = (0.15, 0.75, 1.0)
    """Red, green and blue at full brightness, each 0 to 1."""

    opacity: float = Field(default=0.45, gt=0.0, le=1.0)
    """1 hides what is behind it."""

    def reveals(self) -> tuple[Within, ...]:
        if self._is_constant:
            return ()
        return (Within("how far the tip is from the target", self.far),)

    def provides(self, machine: Machine) -> Names:
        return {"object": ["sphere"]}

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        if self._is_constant:
            return {
                "brightness": "is constant, and smallest and largest are both "
                f"{self.largest:g} m, so that the sphere looks the same at every distance"
            }
        if self.largest < self.far:
            return {}
        return {
            "largest": f"is {self.largest:g} m, and so the sphere reaches from the target to "
            f"a tip that is far, {self.far:g} m away"
        }

    @property
    def _is_constant(self) -> bool:
        return self.smallest == self.largest and self.brightness == "constant"

    @model_validator(mode="after")
    def _sizes_rise(self) -> "SphereSettings":
        if self.smallest > self.largest:
            raise WrongKey(
                f"smallest is {self.smallest:g} m and largest {self.largest:g} m; exchange them",
                at=("smallest",),
            )
        return self
