"""One attached joystick: what it is, where it is plugged in, and its raw numbers."""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane import DeviceError
from labcrane_joystick.settings import AXES

if TYPE_CHECKING:
    from pygame.joystick import JoystickType

NUMBERS = tuple(range(len(AXES)))

TRIGGER = 0
"""The trigger is the first button."""

RAW_PER_UNIT = 32768
"""pygame divides SDL's 16-bit numbers by this."""

DEVICES = Path("/dev/input")


@dataclass(frozen=True, slots=True)
class Stick:
    """An open joystick.

    Attributes
    ----------
    joystick
        pygame's object. Once unplugged, it goes on answering with zeros.
    instance
        SDL's number for this time it was plugged in; never used again.
    model
        USB vendor and product: ``"044f:b10a"``.
    node
        The kernel's device, ``/dev/input/event5``; None where there is none.
    port
        The socket it is plugged into, or the next best thing (see :func:`attached`).
    """

    joystick: JoystickType
    instance: int
    name: str
    guid: str
    model: str
    node: Path | None
    port: str

    @property
    def has_socket(self) -> bool:
        """Whether ``port`` is a socket, and not a place in the order."""
        return not self.port.startswith(self.guid)

    def raw(self) -> list[int]:
        """Return the axes as SDL has them, -32768 to 32767, in the order of ``AXES``."""
        axis = self.joystick.get_axis
        # Exact: a power of two takes no bit away.
        return [int(axis(number) * RAW_PER_UNIT) for number in NUMBERS]

    def trigger(self) -> bool:
        """Return whether the trigger is pulled."""
        return bool(self.joystick.get_button(TRIGGER))

    def __str__(self) -> str:
        axes, buttons = self.joystick.get_numaxes(), self.joystick.get_numbuttons()
        return f"{self.name} ({self.model}, {axes} axes, {buttons} buttons)"


def attached(known: Collection[int] = ()) -> list[Stick]:
    """Open every joystick there is but the instances already known, in SDL's order.

    Two sticks of a model differ in nothing, not even in their GUID: they have no serial number.
    Where the kernel names the socket a stick is plugged into, that tells them apart; elsewhere
    it is their place in the order, which another socket or another start may change.
    """
    import pygame  # noqa: PLC0415 - heavy

    sticks: list[Stick] = []
    guids: list[str] = []
    for index in range(pygame.joystick.get_count()):
        before = open_nodes(DEVICES)
        try:
            joystick = pygame.joystick.Joystick(index)
        except pygame.error as error:
            raise DeviceError(
                f"joystick number {index + 1} cannot be opened: {error}; plug it in again"
            ) from error
        guid = joystick.get_guid()
        guids.append(guid)
        if joystick.get_instance_id() in known:
            continue
        # pygame does not say which node it opened, but the process holds one more than before.
        node = next(iter(open_nodes(DEVICES) - before), None)
        port = socket_of(node, DEVICES) or f"{guid} number {guids.count(guid)}"
        instance, name = joystick.get_instance_id(), joystick.get_name()
        sticks.append(Stick(joystick, instance, name, guid, model_of(guid), node, port))
    return sticks


def matching(sticks: Iterable[Stick], model: str) -> list[Stick]:
    """Return the sticks of one model; one that lacks axes or buttons raises DeviceError."""
    found = [stick for stick in sticks if stick.model == model]
    for stick in found:
        axes, buttons = stick.joystick.get_numaxes(), stick.joystick.get_numbuttons()
        if axes < len(AXES) or buttons <= TRIGGER:
            raise DeviceError(
                f"joystick {stick.name!r} ({model}) has {axes} axes and {buttons} buttons, but "
                f"{len(AXES)} axes ({', '.join(AXES)}) and {TRIGGER + 1} button (trigger) are "
                "needed; plug in another model and name it as 'stick: vendor:product'"
            )
    return found


def pair(sticks: Sequence[Stick], model: str) -> list[Stick]:
    """Return the sticks of one model, two at least, or raise DeviceError."""
    found = matching(sticks, model)
    if len(found) < 2:  # noqa: PLR2004 - two hands
        there = ", ".join(str(stick) for stick in sticks) or "no joystick at all"
        raise DeviceError(
            f"two joysticks {model} are needed, but {len(found) or 'none'} of that model is "
            f"attached; attached: {there}; plug in two, or name another model as "
            "'stick: vendor:product'"
        )
    return found


def model_of(guid: str) -> str:
    """Return vendor and product from SDL's GUID, which holds them as little-endian bytes.

    The whole GUID does not identify a stick: its bus and checksum differ between computers.
    """
    vendor, product = guid[10:12] + guid[8:10], guid[18:20] + guid[16:18]
    return f"{vendor}:{product}"


def open_nodes(folder: Path) -> set[Path]:
    """Return the event devices in ``folder`` that this process holds open; Linux only."""
    linux = sys.platform == "linux" and folder.is_dir()
    nodes = set()
    for link in Path("/proc/self/fd").iterdir() if linux else ():
        try:
            target = link.readlink()
        except FileNotFoundError:  # the listing's own descriptor is gone by now
            continue
        if target.parent == folder and re.fullmatch(r"event\d+", target.name):
            nodes.add(target)
    return nodes


def socket_of(node: Path | None, folder: Path) -> str | None:
    """Return the name udev gave the socket behind ``node``, None where there is none."""
    if node is None or not (folder / "by-path").is_dir():
        return None
    # udev may write several names for one socket: always take the same.
    for link in sorted((folder / "by-path").iterdir()):
        if link.resolve() == node.resolve():
            return link.name
    return None
