"""The goals of one run, in their order."""

import math
from collections.abc import Iterator

import numpy as np

from labcrane import FloatArray, ProtocolError, Run
from labcrane.core import Event, Layout
from labcrane.machines import PlacedObject, Scene, beside, stands

Point = tuple[float, float, float]
ANY = -1.0
"""Opening of the jaws that does not matter."""

NOT_ASKED, TO_TOUCH, TOUCHED = -1.0, 0.0, 1.0
"""Whether something is to be touched, and was."""

OPEN_WITHIN = 0.1
"""Tolerance of the jaws' opening for a goal, as a proportion of their range."""


def check_goals(name: str, scene: Scene, state: Layout) -> None:
    """Refuse a scene of whose goals the machine's state does not say where they are.

    Raises
    ------
    ProtocolError
        Of the first such goal.
    """
    said = _of_things(state, "position")
    known = {"tip", "figure", *scene.things, *said}
    for goal in scene.goals:
        if goal.what not in known:
            raise ProtocolError(
                f"scene {name!r}: a goal names {goal.what!r}, whose position is not in the "
                f"machine's state; the state has positions of {', '.join(said) or 'nothing'}"
            )
        if goal.touch is not None and goal.touch not in (felt := _of_things(state, "force")):
            raise ProtocolError(
                f"scene {name!r}: {goal.touch!r} is to be touched, and the machine's state has no "
                f"force on it; it has one on {', '.join(felt) or 'nothing'}. What is fixed has one "
                "where it has a limit_n"
            )


class GoalSequence:
    """Follows which goal is next."""

    def __init__(self, scene: Scene, placed: tuple[PlacedObject, ...], run: Run) -> None:
        self._goals = scene.goals
        self._placed = {each.name: each for each in placed}
        self._positions = _of_things(run.state, "position")
        self._turns = _of_things(run.state, "orientation")
        self._tip = run.state.find("tip.position")
        self._jaws = run.state.find("joint.angle").stop - 1
        self._opening = run.machine.limits[-1]
        columns = run.state.columns
        self._grip = columns.index("grip.thing") if "grip.thing" in columns else None
        self._felt = {
            goal.touch: self._parts_of(goal.touch, run) for goal in scene.goals if goal.touch
        }
        self._hold_rate = run.rate_hz
        self._held = 0
        self._touched = False
        self.reached = 0

    @property
    def done(self) -> bool:
        """Whether all goals were reached."""
        return self.reached == len(self._goals)

    def position(self, state: FloatArray, what: str) -> Point:
        """Return where the tip or a thing is, in m."""
        if what != "tip" and what not in self._positions:
            return self._placed[what].position  # an obstacle does not move
        x, y, z = state[self._tip if what == "tip" else self._positions[what]].tolist()
        return x, y, z

    def nearest(self, state: FloatArray, what: str, part: str) -> float:
        """Return how far the tip is from the middle of a thing's part, in m."""
        thing = self._placed[what]
        pieces = [each for each in thing.parts if each.name == part]
        segment = f"{what}.{part}"
        # A segment's position is that of its first part; a rigid thing's that of its first part.
        first = pieces[0] if segment in self._turns else thing.parts[0]
        moves = segment if segment in self._turns else what
        if moves in self._turns:
            x, y, z, w = state[self._turns[moves]].tolist()
            at = np.array(self.position(state, moves))
        else:
            where, yaw = stands(thing, first)
            x, y, z, w = 0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)
            at = np.array(where)
        axis = np.array([x, y, z])
        tip = np.array(self.position(state, "tip"))
        found = []
        for each in pieces:
            away = np.array(beside(first, each).centre)
            turned = away + 2.0 * np.cross(axis, np.cross(axis, away) + w * away)
            found.append(float(np.linalg.norm(tip - at - turned)))
        return min(found)

    def see(self, state: FloatArray, due: float) -> Iterator[Event]:
        """Take a tick; yield the goal that was reached in it, if one was."""
        if self.done:
            return
        goal = self._goals[self.reached]
        there = self._there(state)
        if goal.touch is not None:
            there = self._touched = there and self._touches(state, goal.touch)
        self._held = self._held + 1 if there else 0
        if self._held > goal.hold_s * self._hold_rate:
            self.reached, self._held, self._touched = self.reached + 1, 0, False
            yield Event("goal.reached", due, {"goal": self.reached, "what": goal.what})

    def target(self, state: FloatArray) -> tuple[float, float, float, float, float, float, float]:
        """Return where the tip should go, the region's radius, jaws, touch, and the goals reached.

        For a goal that something else must come to, the tip should go there by as much as is
        still missing.
        """
        goal = self._goals[min(self.reached, len(self._goals) - 1)]
        x, y, z = self._place()
        if goal.what != "tip":
            at, tip = self.position(state, goal.what), self.position(state, "tip")
            x, y, z = x + tip[0] - at[0], y + tip[1] - at[1], z + tip[2] - at[2]
        jaws = ANY if goal.jaws is None else goal.jaws
        touch = NOT_ASKED if goal.touch is None else TOUCHED if self._touched else TO_TOUCH
        return x, y, z, goal.radius, jaws, touch, float(self.reached)

    def _parts_of(self, name: str, run: Run) -> list[tuple[int, float]]:
        """Return where the force on each part of a thing is in the state, and its limit in N."""
        limits = self._placed[name].limits
        parts = dict.fromkeys(part.name for part in self._placed[name].parts)
        places = {part: f"scene.{name}.force.{part}" for part in parts}
        return [
            (run.state.index(place), limits.get(part, math.inf))
            for part, place in places.items()
            if place in run.state.columns
        ]

    def _touches(self, state: FloatArray, name: str) -> bool:
        """Whether a thing is touched now, or was before in this goal, and is not pressed hard."""
        forces = [(state.item(place), limit) for place, limit in self._felt[name]]
        if any(force > limit for force, limit in forces):
            return False
        return self._touched or any(force > 0.0 for force, _ in forces)

    def _there(self, state: FloatArray) -> bool:
        goal = self._goals[self.reached]
        if math.dist(self.position(state, goal.what), self._place()) > goal.radius:
            return False
        if goal.grip is not None and (self._grip is None or goal.grip != bool(state[self._grip])):
            return False
        if goal.jaws is None or goal.grip is True:
            return True
        lowest, highest = self._opening
        share = (state.item(self._jaws) - lowest) / (highest - lowest)
        return abs(share - goal.jaws) <= OPEN_WITHIN

    def _place(self) -> Point:
        goal = self._goals[min(self.reached, len(self._goals) - 1)]
        x, y, z = goal.position
        if goal.beside is None:
            return x, y, z
        # The thing as it was placed: turned with it, and not moving with it afterwards.
        thing = self._placed[goal.beside]
        cos, sin = math.cos(thing.yaw), math.sin(thing.yaw)
        ahead, left, up = thing.position
        return ahead + cos * x - sin * y, left + sin * x + cos * y, up + z


def _of_things(state: Layout, quantity: str) -> dict[str, slice]:
    """Return where the state has a quantity of whatever moves, by its name.

    A part of a jointed thing has the thing's name before its own.
    """
    found = {}
    for signal in state.signals:
        first, *name, last = signal.name.split(".")
        if name and first == "scene" and last == quantity:
            found[".".join(name)] = state.find(signal.name)
    return found
