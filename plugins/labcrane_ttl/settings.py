"""Settings of the lines that signal events to other devices."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from pydantic import Field, NonNegativeFloat, PositiveInt, field_validator

from labcrane import Machine, Settings
from labcrane.core import EventName, Names

Code = Annotated[int, Field(ge=1, le=255)]


class LineSettings(Settings):
    """Settings of every line."""

    codes: Annotated[dict[EventName, Code], Field(min_length=1)] | None = None
    """Code, 1 to 255, of each event that is sent. Of several events in one tick, the first in this
    list is sent at once. The default is every event with a number in docs/markers.md, except
    ``movement.onset`` and ``movement.offset``, which are detected late; events that show or do
    something come before those that begin or end something."""

    pulse_s: NonNegativeFloat = 0.01
    """Minimum time for which a code stays on the line, in seconds; it is cleared in a tick. The
    line rests as long before the next code. With 0, the device clears the line."""

    @property
    def spacing_s(self) -> float:
        """Minimum time from one code to the next, in seconds."""
        return 2.0 * self.pulse_s

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        first: dict[int, str] = {}
        for event, code in (self.codes or {}).items():
            if (other := first.setdefault(code, event)) != event:
                return {"codes": f"has {code} for both {other} and {event}, which look the same"}
        return {}


class SerialSettings(LineSettings):
    """Settings of a serial port whose device shows each byte on its lines."""

    port: Annotated[str, Field(min_length=1)]
    """Name of the port: ``/dev/ttyUSB0``, ``COM3``."""

    baud: PositiveInt = 115_200
    """Baud rate of the device."""

    echo: bool = False
    """Whether the device echoes each byte that it shows; each echo is recorded with its delay."""

    def provides(self, machine: Machine) -> Names:
        return {"port": (self.port,)}


class BoxSettings(SerialSettings):
    """Settings of a box that takes commands in words."""

    command: str = "WRITE {code}\n"
    """Command that sets the lines; ``{code}`` is replaced by the code."""

    rest: str = "WRITE 0\n"
    """Command that clears the lines after ``pulse_s``."""

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
    """Settings of a parallel port under Linux. Not tested with a real port."""

    port: Path = Path("/dev/parport0")
    """The port's file: ``modprobe ppdev`` makes it, and the group ``lp`` may open it."""

    def provides(self, machine: Machine) -> Names:
        return {"port": (str(self.port),)}
