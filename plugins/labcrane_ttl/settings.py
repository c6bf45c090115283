"""Settings of the lines that signal events to other devices."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from pydantic import Field, NonNegativeFloat, PositiveInt, field_validator

from labcrane import Machine, Settings
from labcrane.core import EventName, Names

Code = Annotated[int, Field(ge=1, le=255)]


class LineSettings(Settings):
    """What every line has."""

    codes: Annotated[dict[EventName, Code], Field(min_length=1)] | None = None
    """Code of each event that is sent, 1 to 255; of those in one tick the first in this list goes
    out at once. All that have a number in docs/markers.md by default, by that number, what is shown
    or done before what begins or ends, but ``movement.onset`` and ``movement.offset``, which are
    learnt late."""

    pulse_s: NonNegativeFloat = 0.01
    """How long a code stays on the line, in seconds, at least: it is taken off in a tick. For as
    long it rests before the next one. 0 leaves that to the device."""

    @property
    def spacing_s(self) -> float:
        """Least time from one code to the next, in seconds."""
        return 2.0 * self.pulse_s

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        first: dict[int, str] = {}
        for event, code in (self.codes or {}).items():
            if (other := first.setdefault(code, event)) != event:
                return {
                    "codes": f"has {code} for {other} and for {event}, which nobody tells apart"
                }
        return {}


class SerialSettings(LineSettings):
    """Settings of a serial port whose device shows each byte on its lines."""

    port: Annotated[str, Field(min_length=1)]
    """Name of the port: ``/dev/ttyUSB0``, ``COM3``."""

    baud: PositiveInt = 115_200
    """Signs per second, as the device has them."""

    echo: bool = False
    """Whether the device sends back what it shows, byte by byte: each echo is recorded with its
    delay."""

    def provides(self, machine: Machine) -> Names:
        return {"port": (self.port,)}


class BoxSettings(SerialSettings):
    """Settings of a box that takes commands in words."""

    command: str = "WRITE {code}\n"
    """What sets the lines; ``{code}`` stands for the number."""

    rest: str = "WRITE 0\n"
    """What clears them when ``pulse_s`` is over."""

    @field_validator("command")
    @classmethod
    def _has_a_code(cls, command: str) -> str:
        if command.count("{code}") != 1 or command.replace("{code}", "").count("{"):
            raise ValueError(f"{command!r} must have {{code}} in it once, as 'WRITE {{code}}\\n'")
        return command

    def written(self, code: int) -> bytes:
        """Return the command for a code."""
        return self.command.replace("{code}", str(code)).encode()


class ParallelSettings(LineSettings):
    """Settings of a parallel port under Linux. Not tried on a real one."""

    port: Path = Path("/dev/parport0")
    """The port's file: ``modprobe ppdev`` makes it, and the group ``lp`` may open it."""

    def provides(self, machine: Machine) -> Names:
        return {"port": (str(self.port),)}
