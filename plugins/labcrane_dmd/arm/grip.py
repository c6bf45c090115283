"""The grip of the jaws on a thing."""

from collections.abc import Mapping
from dataclasses import dataclass

from labcrane_dmd.arm.contacts import LINK_B, Contacts, ContactWindow, Key
from labcrane_dmd.arm.engine import pybullet
from labcrane_dmd.arm.scene_bodies import StandingBody

BELOW_M = 20.0
"""As far down as is looked for what is under a thing."""

BODY, POINT = 0, 3
"""Places of the body and of the point in what the engine says of a ray."""

RAYS, PAST_M = 16, 0.005
"""How often a ray that met the arm or what is held goes on, and how far under it, in metres."""


@dataclass
class Held:
    """A thing in the grip.

    How it is fixed, by which of its parts and links, how far the jaws were open, what pulls at it,
    and with how much more than at first the jaws press.
    """

    standing: StandingBody
    constraint: int
    part: str
    link: int
    opening: float
    pull: ContactWindow
    squeeze: float = 0.0


class Grip:
    """Forms when both jaws press on a thing, breaks when it is pulled out or let go.

    Parameters
    ----------
    arm, jaws, client
        Number of the arm, of its two jaws' links, and of the engine.
    press
        Force of each jaw, in N, above which a grip forms.
    release
        Opening of the jaws, in rad, that lets go.
    ticks
        Length of the window of the force.
    """

    def __init__(
        self, arm: int, jaws: tuple[int, int], client: int, press: float, release: float, ticks: int
    ) -> None:
        self._arm, self._jaws, self._client = arm, jaws, client
        self._press, self._release, self._ticks = press, release, ticks
        self.held: Held | None = None
        self.force = 0.0
        self.height = 0.0
        self.drops = 0

    def tighten(self, force: float) -> None:
        """Press on what is held with so much more, in N."""
        if self.held is not None:
            self.held.squeeze += force

    def squeezed(self, most: float) -> Mapping[Key, float]:
        """Return with how much the jaws press on what they hold, each with ``most`` N at most."""
        if self.held is None or self.held.squeeze == 0.0:
            return {}
        self.held.squeeze = min(self.held.squeeze, most)
        both = 2.0 * self.held.squeeze
        return {(self.held.standing.placed.name, self.held.part): both}

    def look(self, contacts: Contacts, things: list[StandingBody], opening: float) -> None:
        """Form, keep or break the grip after a tick; ``opening`` is the jaws' angle in rad."""
        if self.held is None:
            for each in things:
                pressed = [contacts.by_link.get((each.placed.name, jaw), 0.0) for jaw in self._jaws]
                if each.placed.kind != "obstacle" and min(pressed) > self._press:
                    self._take(each, opening)
                    return
            return
        pulled = pybullet.getConstraintState(self.held.constraint, physicsClientId=self._client)
        self.height = self._height(self.held)
        self.force = self.held.pull.add(sum(part * part for part in pulled[:3]) ** 0.5)
        if self.force > self.held.standing.placed.slip:
            self.drops += 1
            self._let_go()
        elif opening > self.held.opening + self._release:
            self._let_go()

    def _take(self, each: StandingBody, opening: float) -> None:
        touched = self._touched(each)
        limb = each.placed.kind == "body"
        constraint = self._hold_limb(each, touched) if limb else self._hold(each)
        # What is held is part of the hand: jaws that went on pressing would fight the constraint.
        self._collide(each, touch=False)
        self.held = Held(
            each, constraint, each.parts[touched], touched, opening, ContactWindow(self._ticks)
        )
        self.force, self.height = 0.0, self._height(self.held)

    def _height(self, held: Held) -> float:
        """Return how far what is held could fall, in m: of somebody, the limb in the jaws.

        That is from its lowest height straight down to the first thing that is neither the arm nor
        what is held, under its middle.
        """
        body, client = held.standing.body, self._client
        limb = held.standing.placed.jointed
        links = [held.link] if limb else list(held.standing.parts)
        boxes = [pybullet.getAABB(body, link, physicsClientId=client) for link in links]
        lowest = min(low[2] for low, _ in boxes)
        x, y = (
            0.5 * (min(low[axis] for low, _ in boxes) + max(high[axis] for _, high in boxes))
            for axis in (0, 1)
        )
        top = lowest
        for _ in range(RAYS):
            (met,) = pybullet.rayTestBatch(
                [[x, y, top]], [[x, y, lowest - BELOW_M]], physicsClientId=client
            )
            if met[BODY] not in {self._arm, body}:
                # Where nothing is met it is in the ground: the engine's boxes have a margin.
                return float(max(0.0, lowest - met[POINT][2])) if met[BODY] >= 0 else 0.0
            top = met[POINT][2] - PAST_M
        return 0.0

    def _hold(self, each: StandingBody) -> int:
        """Fix an object to the hand."""
        client, hand = self._client, self._jaws[1]
        state = pybullet.getLinkState(self._arm, hand, physicsClientId=client)
        place = pybullet.getBasePositionAndOrientation(each.body, physicsClientId=client)
        inverse = pybullet.invertTransform(*state[:2])  # the link's centre of mass, as bullet wants
        offset = pybullet.multiplyTransforms(*inverse, *place)
        constraint: int = pybullet.createConstraint(
            self._arm,
            hand,
            each.body,
            -1,
            pybullet.JOINT_FIXED,
            [0.0, 0.0, 0.0],
            offset[0],
            [0.0, 0.0, 0.0],
            parentFrameOrientation=offset[1],
            physicsClientId=client,
        )
        return constraint

    def _touched(self, each: StandingBody) -> int:
        """Return the link of a thing that a jaw touches."""
        touching = pybullet.getContactPoints(
            self._arm, each.body, self._jaws[1], physicsClientId=self._client
        )
        return int(touching[0][LINK_B]) if touching else -1

    def _hold_limb(self, each: StandingBody, link: int) -> int:
        """Hold a body at one point: a limb turns in the hand that has hold of it."""
        client, hand = self._client, self._jaws[1]
        grabbed = pybullet.getLinkState(self._arm, hand, physicsClientId=client)[0]
        place = (
            pybullet.getBasePositionAndOrientation(each.body, physicsClientId=client)
            if link < 0
            else pybullet.getLinkState(each.body, link, physicsClientId=client)[:2]
        )
        inverse = pybullet.invertTransform(*place)
        point = pybullet.multiplyTransforms(*inverse, grabbed, [0.0, 0.0, 0.0, 1.0])[0]
        constraint: int = pybullet.createConstraint(
            self._arm,
            hand,
            each.body,
            link,
            pybullet.JOINT_POINT2POINT,
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0],
            point,
            physicsClientId=client,
        )
        return constraint

    def _let_go(self) -> None:
        if self.held is None:
            return
        pybullet.removeConstraint(self.held.constraint, physicsClientId=self._client)
        self._collide(self.held.standing, touch=True)
        self.held, self.force, self.height = None, 0.0, 0.0

    def _collide(self, each: StandingBody, *, touch: bool) -> None:
        for jaw in self._jaws:
            for link in each.parts:
                pybullet.setCollisionFilterPair(
                    self._arm, each.body, jaw, link, int(touch), physicsClientId=self._client
                )
