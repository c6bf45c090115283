"""Settings of a panel on a CAN bus."""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from importlib.util import find_spec
from typing import Annotated

from pydantic import (
    Field,
    PositiveFloat,
    PositiveInt,
    ValidationInfo,
    field_validator,
    model_validator,
)

from labcrane import Machine, Settings
from labcrane.core import JointName, Names, Once, Reference, StudyPath, WrongKey, was_run

Node = Annotated[int, Field(ge=0, le=253)]
"""Source address on the bus; 254 and 255 do not identify a node."""

BUS = r"^[a-z0-9_]+:.+$"

FAMILIAR = frozenset(
    {"slcan", "socketcan", "socketcand", "pcan", "kvaser", "vector", "virtual", "udp_multicast"}
)
"""Interfaces that are known without loading python-can, which takes long."""

Valve = Annotated[int, Field(ge=1, le=15)]
"""Number of an auxiliary valve; 0 is "power beyond" and moves no joint."""


DbcSignal = Annotated[str, Reference("signal of the map", own=True)]
"""Name of a message of the DBC file, and of a signal of it: ``Levers.Boom``."""


class Lever(Settings):
    """A lever whose value has no sign: signals of the same message give its side, as in J1939."""

    value: DbcSignal
    """How far it is moved: ``BJM1.X``."""

    positive: DbcSignal
    """The signal that is 1 while it is moved to the side where the valve extends, else 0."""

    negative: DbcSignal
    """The signal that is 1 while it is moved to the other side, else 0."""


class ValveMap(Settings):
    """The assignment of valve commands to joints."""

    valves: Annotated[dict[JointName, Valve | DbcSignal | Lever], Once()]
    """For each joint, the number of its auxiliary valve; with ``map``, the names of message and
    signal: ``Levers.Boom``. A J1939 joystick sends how far a lever is moved, and its side in
    signals of their own: ``{value: BJM1.X, positive: BJM1.XRight, negative: BJM1.XLeft}``."""

    map: StudyPath | None = None
    """DBC file, for panels that do not send auxiliary valve commands."""

    neutral: float = 0.0
    """Value of a DBC signal at rest, where the valve is shut, in the signal's own unit: 50 for a
    lever that counts from 0 to 100."""

    full: float = 100.0
    """Value of a DBC signal at full flow, in the signal's own unit. The same distance on the other
    side of ``neutral`` is full flow in the other direction, unless a signal of its own gives the
    side."""

    node: Node | None = None
    """Source address of the panel; any by default."""

    priority: int | None = Field(default=None, ge=0, le=7)
    """Priority of the panel's messages; any by default. Auxiliary valve commands have 3."""

    timeout_s: PositiveFloat = 0.25
    """Age, in seconds, at which a valve's last command expires and the valve shuts. The panel is
    lost when the commands of all valves, or of an open valve, have expired."""

    def provides(self, machine: Machine) -> Names:
        pairs = [f"{what}.{joint}" for what in ("valve", "float") for joint in self.valves]
        named: Names = {
            "axis": [*pairs, "panel.connected"],
            "button": [f"float.{joint}" for joint in self.valves],
        }
        if self.map is not None and self.map.exists() and find_spec("cantools"):
            from labcrane_can.dbc import check_ranges, every_signal  # noqa: PLC0415 - loads for a moment

            check_ranges(self)
            return {**named, "signal of the map": every_signal(self.map)}
        return named

    def needs(self, machine: Machine) -> Names:
        self.provides(machine)  # the protocol's check reports a file that is not a map
        return {}

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        if self.map is None or not self.map.exists() or not find_spec("cantools"):
            return {}
        from labcrane_can.dbc import stated_ranges  # noqa: PLC0415 - loads for a moment

        for name, (least, most) in stated_ranges(self).items():
            backwards = self.backwards(name)
            said = f"is {self.full:g}, and {name} goes from {least:g} to {most:g}"
            if most > self.full or least < backwards:
                return {"full": f"{said}: what is beyond {backwards:g} to {self.full:g} is refused"}
            if most < self.full or least > backwards:
                return {"full": f"{said}, so that the valve is never fully open"}
        return {}

    def numbers(self) -> dict[JointName, Valve]:
        """Return the valve of each joint that has a number."""
        return {joint: each for joint, each in self.valves.items() if isinstance(each, int)}

    def levers(self) -> dict[JointName, tuple[DbcSignal, ...]]:
        """Return the signals of each joint's lever: its value and, if it has any, its two sides."""
        return {
            joint: (each.value, each.positive, each.negative)
            if isinstance(each, Lever)
            else (each,)
            for joint, each in self.valves.items()
            if not isinstance(each, int)
        }

    def backwards(self, name: str) -> float:
        """Return the least value of a DBC signal: full flow in the other direction, or rest."""
        sided = any(value == name and sides for value, *sides in self.levers().values())
        return self.neutral if sided else 2 * self.neutral - self.full

    @model_validator(mode="after")
    def _full_is_above_neutral(self) -> "ValveMap":
        if self.full <= self.neutral:
            raise WrongKey(
                f"full is {self.full:g} and neutral {self.neutral:g}; full flow is a greater value "
                "than the one at rest",
                at=("full",),
            )
        return self

    @model_validator(mode="after")
    def _names_need_a_map(self) -> "ValveMap":
        for joint, valve in self.valves.items():
            if not isinstance(valve, int) and self.map is None:
                named = valve.value if isinstance(valve, Lever) else valve
                raise WrongKey(
                    f"valves has {joint}: {named!r}, which only a DBC file explains; give map, or "
                    "the valve's number",
                    at=("valves", joint),
                )
            if isinstance(valve, int) and self.map is not None:
                raise WrongKey(
                    f"valves has {joint}: {valve}, a number, beside a DBC map; write message and "
                    "signal: Levers.Boom",
                    at=("valves", joint),
                )
        return self


class CanSettings(ValveMap):
    """A panel on a live bus."""

    bus: str = Field(json_schema_extra={"pattern": BUS})
    """Interface and channel of python-can: ``slcan:/dev/ttyACM0``, ``socketcan:can0``,
    ``socketcand:can0@192.168.1.5:29536``, ``pcan:PCAN_USBBUS1``."""

    bitrate: PositiveInt = 250_000
    """Bits per second; 250 000 is J1939's."""

    feedback: bool = True
    """Whether estimated and measured flow are sent back to the panel, ten times a second."""

    @field_validator("bus")
    @classmethod
    def _can_be_looked_for(cls, bus: str, info: ValidationInfo) -> str:
        if was_run(info):
            return bus
        if not re.match(BUS, bus):
            raise ValueError(
                f"{bus!r} is not a bus; write interface:channel, as slcan:/dev/ttyACM0 or "
                "socketcan:can0"
            )
        interface, _, channel = bus.partition(":")
        if why := _unknown(interface):
            raise ValueError(f"{bus!r}: {why}")
        if interface == "socketcan" and not re.fullmatch(r"[^/\s]{1,15}", channel):
            raise ValueError(
                f"{channel!r} is not a network interface; write its name, as socketcan:can0, or "
                "for a serial adapter slcan:/dev/ttyACM0"
            )
        port = bus.partition("@")[2].partition(":")[2]
        if bus.startswith("socketcand:") and port and not port.isdecimal():
            raise ValueError(
                f"{port!r} is not a port; write socketcand:channel@host:port, or omit the port"
            )
        return bus


def _unknown(interface: str) -> str:
    """Return why python-can has no such interface; nothing where it has, or is not installed."""
    if interface in FAMILIAR or not find_spec("can"):
        return ""
    from can.interfaces import VALID_INTERFACES  # noqa: PLC0415 - few are none of the familiar ones

    if interface in VALID_INTERFACES:
        return ""
    close = get_close_matches(interface, VALID_INTERFACES, n=1)
    meant = f"did you mean {close[0]!r}? " if close else ""
    every = ", ".join(sorted(VALID_INTERFACES))
    return f"python-can has no interface {interface!r}; {meant}it has {every}"
