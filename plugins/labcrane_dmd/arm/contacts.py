"""Contact forces: impulses over a short time, divided by it."""

from collections import deque
from collections.abc import Mapping, Sequence

from labcrane_dmd.arm.engine import pybullet
from labcrane_dmd.arm.scene_bodies import Standing

Key = tuple[str, str]
"""A thing and one of its parts."""

BODY_B, LINK_A, LINK_B, NORMAL_FORCE = 2, 3, 4, 9
"""Places in the engine's contact points."""


class Window:
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
    """What presses on each part of each thing.

    ``pressed`` is by the machine and by things that move; ``support`` by the ground and obstacles.
    Contact points at a distance have no force; the engine lists them all the same.

    ``by_link`` is the force of each of the arm's links on each thing. All in N.

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
        self, standing: Sequence[Standing], arm: int, ground: int, client: int, ticks: int
    ) -> None:
        self._client = client
        self._things = [each for each in standing if each.placed.kind != "obstacle"]
        obstacles = {each.body for each in standing if each.placed.kind == "obstacle"}
        self._still = obstacles | {ground}
        self._arm = arm
        keys = [(each.placed.name, part) for each in self._things for part in _names(each)]
        self._pressed = {key: Window(ticks) for key in keys}
        self._support = {each.placed.name: Window(ticks) for each in self._things}
        self._links: dict[tuple[str, int], Window] = {}
        self._ticks = ticks
        self.pressed: Mapping[Key, float] = dict.fromkeys(keys, 0.0)
        self.support: Mapping[str, float] = dict.fromkeys(self._support, 0.0)
        self.by_link: Mapping[tuple[str, int], float] = {}

    def look(self) -> None:
        """Read the contacts of the tick that was just made."""
        pressed = dict.fromkeys(self._pressed, 0.0)
        support = dict.fromkeys(self._support, 0.0)
        by_link: dict[tuple[str, int], float] = {}
        for each in self._things:
            name = each.placed.name
            for point in pybullet.getContactPoints(bodyA=each.body, physicsClientId=self._client):
                force, other = point[NORMAL_FORCE], point[BODY_B]
                if force <= 0.0 or other == each.body:
                    continue
                if other in self._still:
                    support[name] += force
                else:
                    pressed[name, each.parts[point[LINK_A]]] += force
                if other == self._arm:
                    key = (name, point[LINK_B])
                    by_link[key] = by_link.get(key, 0.0) + force
        self.pressed = {key: self._pressed[key].add(force) for key, force in pressed.items()}
        self.support = {name: self._support[name].add(force) for name, force in support.items()}
        for key in by_link.keys() | self._links.keys():
            window = self._links.setdefault(key, Window(self._ticks))
            window.add(by_link.get(key, 0.0))
        self.by_link = {key: window.force for key, window in self._links.items()}


def _names(standing: Standing) -> list[str]:
    return list(dict.fromkeys(standing.parts.values()))
