"""Settings of the detection response task, and of the light that presents its stimuli."""

from typing import Annotated

from pydantic import Field, PositiveFloat, model_validator

from labcrane import Machine, Settings
from labcrane.core import AxisName, Names, SignalName, Unit, WrongKey


class DrtSettings(Settings):
    """Timing and response of the detection response task; the defaults are those of ISO 17488."""

    response: AxisName = "left.trigger"
    """What the operator responds with: a button, a key, a pedal; any axis of the input."""

    threshold: float = Field(default=0.5, gt=0.0, lt=1.0)
    """Deflection of that axis from which on it is a response, as a fraction of full scale."""

    interval_s: tuple[PositiveFloat, PositiveFloat] = (3.0, 5.0)
    """Shortest and longest time from one stimulus onset to the next, in seconds; all times between
    them are equally likely."""

    longest_s: PositiveFloat = 1.0
    """Duration of a stimulus without a response, in seconds; a response ends it."""

    hit_s: tuple[PositiveFloat, PositiveFloat] = (0.1, 2.5)
    """Shortest and longest response time of a hit, in seconds. An earlier response is a cheat; none
    until then is a miss."""

    def needs(self, machine: Machine) -> Names:
        return {"axis": [self.response.removeprefix("-")]}

    def provides(self, machine: Machine) -> Names:
        return {"event": ["drt.stimulus", "drt.response", "drt.outcome"], "object": ()}

    @model_validator(mode="after")
    def _one_stimulus_at_a_time(self) -> "DrtSettings":
        for name in ("interval_s", "hit_s"):
            least, most = getattr(self, name)
            if least > most:
                raise WrongKey(
                    f"{name} is {least:g} to {most:g} s; write the shorter one first", at=(name,)
                )
        if max(self.hit_s[1], self.longest_s) >= self.interval_s[0]:
            raise WrongKey(
                f"a response may come {self.hit_s[1]:g} s after a stimulus, which lasts "
                f"{self.longest_s:g} s, and the next one may come after {self.interval_s[0]:g} s; "
                "write a longer interval_s",
                at=("interval_s",),
            )
        return self


class LightSettings(Settings):
    """A light that is on while a stimulus is."""

    stimulus: SignalName
    """The stimulus: ``drt.stimulus`` of a secondary task that the protocol calls ``drt``."""

    at: tuple[float, float, float] = (6.0, 1.5, 3.0)
    """Centre of the light, in metres in the machine's base frame."""

    size: Annotated[PositiveFloat, Unit("m")] = 0.1
    """Radius of the light, in metres."""

    colour: tuple[float, float, float] = (1.0, 0.0, 0.0)
    """Red, green and blue, 0 to 1; the standard's light is red."""

    def provides(self, machine: Machine) -> Names:
        return {"object": ["light"]}
