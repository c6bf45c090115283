"""Contact forces: impulses over a short time, divided by it."""

from collections import deque
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from labcrane_dmd.arm.engine import pybullet
from labcrane_dmd.arm.scene_bodies import StandingBody

Key = tuple[str, str]
"""A thing and one of its parts."""

KeyT = TypeVar("KeyT", bound=Hashable)

BODY_B, LINK_A, LINK_B, NORMAL_FORCE = 2, 3, 4, 9
"""Places in the engine's contact points."""


class ContactWindow:
    """The mean of the last ticks of one force, in N."""

    def __init__(self, ticks: int) -> None:
        self._last: deque[float] = deque([0.0] * ticks, maxlen=ticks)

    @property
    def force(self) -> float:
        """The impulse over the window divided by its length, in N."""
        return sum(self._last) / len(self._last)

    def add(self, force: float) -> float:
        """Take a tick's force in N; return what :attr:`force` is then."""
        self._last.append(force)
        return self.force


class Contacts:
    """The contact forces on each part of each thing, in N.

    ``pressed`` is the force of the machine and of moving things; on fixed things, of the machine
    alone. ``support`` is the force of the ground and of obstacles. ``hits`` is the force of
    obstacles on the parts of articulated figures, except of obstacles that carry them. ``grounds``
    is the force on the same parts of the ground and of the things that carry them. The engine also
    lists contact points at a distance, which have no force.

    ``by_link`` is the force of each of the arm's links on each thing; ``fixed`` is their force on
    fixed things with a limit.

    Parameters
    ----------
    standing
        The scene's things.
    arm, ground, client
        Their numbers in the engine.
    ticks
        Length of the window.
    """

    def __init__(
        self, standing: Sequence[StandingBody], arm: int, ground: int, client: int, ticks: int
    ) -> None:
        self._client = client
        self._things = [each for each in standing if each.placed.kind != "obstacle"]
        obstacles = [each for each in standing if each.placed.kind == "obstacle"]
        self._limited = [each for each in obstacles if each.placed.limits]
        self._still = {each.body for each in obstacles} | {ground}
        self._hard = {each.body for each in obstacles if not each.placed.carries}
        self._arm = arm
        self._ticks = ticks
        keys = [
            (each.placed.name, part)
            for each in (*self._things, *self._limited)
            for part in _names(each)
        ]
        jointed = [each for each in self._things if each.placed.jointed]
        self._hits = self._windows(
            (each.placed.name, part) for each in jointed for part in _names(each)
        )
        self._grounds = self._windows(self._hits)
        self._pressed = self._windows(keys)
        self._support = self._windows(each.placed.name for each in self._things)
        self._links: dict[tuple[str, int], ContactWindow] = {}
        self._fixed: dict[int, ContactWindow] = {}
        self.pressed: Mapping[Key, float] = dict.fromkeys(keys, 0.0)
        self.hits: Mapping[Key, float] = dict.fromkeys(self._hits, 0.0)
        self.grounds: Mapping[Key, float] = dict.fromkeys(self._grounds, 0.0)
        self.support: Mapping[str, float] = dict.fromkeys(self._support, 0.0)
        self.by_link: Mapping[tuple[str, int], float] = {}
        self.fixed: Mapping[int, float] = {}

    def look(self, squeezed: Mapping[Key, float]) -> None:
        """Read the contacts of the tick that was just made, and add what the grip presses with."""
        pressed = dict.fromkeys(self._pressed, 0.0)
        for key, force in squeezed.items():
            pressed[key] += force
        hits = dict.fromkeys(self._hits, 0.0)
        grounds = dict.fromkeys(self._grounds, 0.0)
        support = dict.fromkeys(self._support, 0.0)
        by_link: dict[tuple[str, int], float] = {}
        for each in self._things:
            name = each.placed.name
            for point in self._touching(bodyA=each.body):
                force, other = point[NORMAL_FORCE], point[BODY_B]
                if force <= 0.0 or other == each.body:
                    continue
                part = each.parts[point[LINK_A]]
                if other in self._still:
                    support[name] += force
                    if each.placed.jointed:
                        met = hits if other in self._hard else grounds
                        met[name, part] += force
                else:
                    pressed[name, part] += force
                if other == self._arm:
                    pressing = (name, point[LINK_B])
                    by_link[pressing] = by_link.get(pressing, 0.0) + force
        fixed: dict[int, float] = {}
        for each in self._limited:
            for point in self._touching(bodyA=each.body, bodyB=self._arm):
                force, link = max(0.0, point[NORMAL_FORCE]), point[LINK_B]
                pressed[each.placed.name, each.parts[point[LINK_A]]] += force
                fixed[link] = fixed.get(link, 0.0) + force
        self.pressed = _added(self._pressed, pressed)
        self.hits = _added(self._hits, hits)
        self.grounds = _added(self._grounds, grounds)
        self.support = _added(self._support, support)
        self.by_link = self._grown(self._links, by_link)
        self.fixed = self._grown(self._fixed, fixed)

    def _touching(self, **bodies: int) -> tuple[Any, ...]:
        found: tuple[Any, ...] = pybullet.getContactPoints(**bodies, physicsClientId=self._client)
        return found

    def _windows(self, keys: Iterable[KeyT]) -> dict[KeyT, ContactWindow]:
        return {key: ContactWindow(self._ticks) for key in keys}

    def _grown(
        self, windows: dict[KeyT, ContactWindow], forces: Mapping[KeyT, float]
    ) -> Mapping[KeyT, float]:
        """Add forces of what may press for the first time."""
        for key in forces.keys() | windows.keys():
            windows.setdefault(key, ContactWindow(self._ticks)).add(forces.get(key, 0.0))
        return {key: window.force for key, window in windows.items()}


def _added(
    windows: Mapping[KeyT, ContactWindow], forces: Mapping[KeyT, float]
) -> Mapping[KeyT, float]:
    return {key: windows[key].add(force) for key, force in forces.items()}


def _names(standing: StandingBody) -> list[str]:
    return list(dict.fromkeys(standing.parts.values()))
