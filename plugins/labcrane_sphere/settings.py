"""Settings of the sphere."""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from labcrane import Machine, Settings
from labcrane.core import ByEstimate, Names, Unit, Within, WrongKey

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class SphereSettings(Settings):
    """Where the sphere is, and how it follows the distance.

    The published study reports that brightness and size change, but no formulas: the defaults are
    our proposal.
    """

    at: Literal["target", "tip"] = "target"
    """Position of the sphere."""

    far: Annotated[PositiveFloat, Unit("m")] = 4.0
    """Distance between tip and target, in metres, beyond which the sphere no longer changes."""

    law: Literal["linear", "log"] = "linear"
    """How the sphere changes with distance; ``log`` changes most near the target."""

    polarity: Literal["shrinks", "grows"] = "shrinks"
    """How its size changes as the tip approaches the target."""

    brightness: Literal["brightens", "darkens", "constant"] = "brightens"
    """How its brightness changes as the tip approaches the target."""

    smallest: Annotated[PositiveFloat, Unit("m")] = 0.15
    """Smallest radius, in metres."""

    largest: Annotated[PositiveFloat, Unit("m")] = 0.60
    """Largest radius, in metres."""

    darkest: NonNegativeFloat = Field(default=0.25, lt=1.0)
    """Smallest brightness, 1 being the full colour."""

    colour: tuple[Share, Share, Share] = (0.15, 0.75, 1.0)
    """Red, green and blue at full brightness, each 0 to 1."""

    opacity: Annotated[float, Field(gt=0.0, le=1.0)] | ByEstimate = 0.45
    """Opacity; 1 hides everything behind the sphere. Or an opacity that follows an estimate."""

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
