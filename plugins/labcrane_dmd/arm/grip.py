"""The grip of the jaws on a thing."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from labcrane_dmd.arm.contacts import LINK_B, Contacts, ContactWindow, Key
from labcrane_dmd.arm.engine import pybullet
from labcrane_dmd.arm.scene_bodies import StandingBody

BELOW_M = 20.0
"""Distance in which the search looks for what is under a thing."""

BODY, POINT = 0, 3
"""Indices of the body and of the point in the engine's result for a ray."""

NEAR_M = 0.01
"""A thing has left the jaws when neither of them is nearer to it than this, in metres."""

RAYS, PAST_M = 16, 0.005
"""Number of times that a ray continues below the arm or the held thing, and the distance below it,
in metres."""


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


@dataclass
class Loose:
    """A thing that is no longer in the grip and has not yet left the jaws.

    Where it was when it was highest: its lowest height, and that above the hand, in m.
    """

    standing: StandingBody
    link: int
    lowest: float = -math.inf
    beside: float = 0.0


class Grip:
    """A grip, which forms when both jaws press on a thing, and ends when it slips or is released.

    A thing that slipped can be gripped again only after the jaws were opened; while it is still at
    the jaws, they cannot grip another thing. An episode begins with a grip and ends when the thing
    has left the jaws. ``left`` is the number of ended episodes. ``slipped`` tells whether the last
    thing came loose by itself. ``height``, in m, is how far the held thing could fall; for the last
    loose thing, how far it fell past the jaws plus how far it could still fall when it left them.

    Parameters
    ----------
    arm, jaws, client
        Number of the arm, of its two jaws' links, and of the engine.
    press
        Force of each jaw, in N, above which a grip forms.
    release
        Opening of the jaws, in rad, that lets go, and after which they can grip again.
    ticks
        Length of the window of the force.
    """

    def __init__(
        self, arm: int, jaws: tuple[int, int], client: int, press: float, release: float, ticks: int
    ) -> None:
        self._arm, self._jaws, self._client = arm, jaws, client
        self._press, self._release, self._ticks = press, release, ticks
        self._shut: float | None = None
        self.held: Held | None = None
        self.loose: Loose | None = None
        self.force = 0.0
        self.height = 0.0
        self.slipped = False
        self.left = 0

    def tighten(self, force: float) -> None:
        """Increase the force on the held thing by ``force``, in N."""
        if self.held is not None:
            self.held.squeeze += force

    def squeezed(self, most: float) -> Mapping[Key, float]:
        """Return the force of both jaws on the held thing, at most ``most`` N for each jaw."""
        if self.held is None or self.held.squeeze == 0.0:
            return {}
        self.held.squeeze = min(self.held.squeeze, most)
        both = 2.0 * self.held.squeeze
        return {(self.held.standing.placed.name, self.held.part): both}

    def look(self, contacts: Contacts, things: list[StandingBody], opening: float) -> None:
        """Form, keep or break the grip after a tick; ``opening`` is the jaws' angle in rad."""
        if self.held is not None:
            self._pull(self.held, opening)
            return
        if self._can_grip(opening):
            for each in things if self.loose is None else [self.loose.standing]:
                pressed = [contacts.by_link.get((each.placed.name, jaw), 0.0) for jaw in self._jaws]
                if each.placed.kind != "obstacle" and min(pressed) > self._press:
                    self._take(each, opening)
                    return
        if self.loose is not None:
            self._follow(self.loose)

    def _can_grip(self, opening: float) -> bool:
        """Whether the jaws were opened since something slipped out of them."""
        if self._shut is None:
            return True
        self._shut = min(self._shut, opening)
        if opening > self._shut + self._release:
            self._shut = None
        return self._shut is None

    def _pull(self, held: Held, opening: float) -> None:
        pulled = pybullet.getConstraintState(held.constraint, physicsClientId=self._client)
        self.height = self._height(held.standing, held.link)
        self.force = held.pull.add(sum(part * part for part in pulled[:3]) ** 0.5)
        slipped = self.force > held.standing.placed.slip
        if slipped or opening > held.opening + self._release:
            self._shut = opening if slipped else None
            self._let_go(held, slipped=slipped)

    def _follow(self, loose: Loose) -> None:
        """Measure how far what is loose falls past the jaws, until it has left them.

        What is lowered in them, or stands still while they are raised, does not fall.
        """
        lowest = min(low[2] for low, _ in self._boxes(loose.standing, loose.link))
        hand = pybullet.getLinkState(self._arm, self._jaws[1], physicsClientId=self._client)
        beside = lowest - hand[0][2]
        if lowest > loose.lowest:
            loose.lowest, loose.beside = lowest, beside
        fell = max(0.0, min(loose.lowest - lowest, loose.beside - beside))
        self.height = fell + self._height(loose.standing, loose.link)
        if not any(self._near(loose, jaw) for jaw in self._jaws):
            self.left += 1
            self.loose = None

    def _near(self, loose: Loose, jaw: int) -> bool:
        body, client = loose.standing.body, self._client
        # For a casualty, only the held limb counts: the other limbs may touch the arm anywhere.
        limb = {"linkIndexB": loose.link} if loose.standing.placed.jointed else {}
        return bool(
            pybullet.getClosestPoints(
                self._arm, body, NEAR_M, linkIndexA=jaw, **limb, physicsClientId=client
            )
        )

    def _take(self, each: StandingBody, opening: float) -> None:
        self.loose = None
        touched = self._touched(each)
        limb = each.placed.kind == "body"
        constraint = self._hold_limb(each, touched) if limb else self._hold(each)
        # What is held is part of the hand: jaws that went on pressing would fight the constraint.
        self._collide(each, touch=False)
        self.held = Held(
            each, constraint, each.parts[touched], touched, opening, ContactWindow(self._ticks)
        )
        self.force, self.height = 0.0, self._height(each, touched)

    def _boxes(self, standing: StandingBody, link: int) -> list[tuple[Sequence[float], ...]]:
        """Return the boxes around a thing's parts; for a casualty, around the limb in the jaws."""
        links = [link] if standing.placed.jointed else list(standing.parts)
        client = self._client
        return [pybullet.getAABB(standing.body, each, physicsClientId=client) for each in links]

    def _height(self, standing: StandingBody, link: int) -> float:
        """Return how far a thing could fall, in m; for a casualty, the limb in the jaws.

        This is the distance from its lowest point straight down, under its middle, to the first
        thing that is neither the arm nor held.
        """
        body, client = standing.body, self._client
        boxes = self._boxes(standing, link)
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

    def _let_go(self, held: Held, *, slipped: bool) -> None:
        pybullet.removeConstraint(held.constraint, physicsClientId=self._client)
        self._collide(held.standing, touch=True)
        self.loose = Loose(held.standing, held.link)
        self.held, self.force, self.slipped = None, 0.0, slipped

    def _collide(self, each: StandingBody, *, touch: bool) -> None:
        for jaw in self._jaws:
            for link in each.parts:
                pybullet.setCollisionFilterPair(
                    self._arm, each.body, jaw, link, int(touch), physicsClientId=self._client
                )
