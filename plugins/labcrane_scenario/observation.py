"""Observation of a scene: forces, overloads, drops, and where everything is."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from labcrane import FloatArray, Run
from labcrane.core import Event, Value
from labcrane.machines import PlacedObject
from labcrane_scenario.mistakes import Episode, Mistakes
from labcrane_scenario.settings import ScenarioSettings

GRAVITY = 9.81


@dataclass(frozen=True, slots=True)
class Watched:
    """One limited part of a thing, and where a force on it sits in the state.

    Attributes
    ----------
    kind
        Of the mistake: an obstacle is an object too.
    against
        What presses, as far as the scene knows: what moves, or what is fixed.
    """

    thing: PlacedObject
    part: str
    kind: str
    against: str
    place: int
    support: int | None
    limit: float
    episode: Episode


MOVING, FIXED = "moving", "fixed"


class Observation:
    """Watches one trial's scene, and turns what goes wrong into events.

    An object's limit also holds for what it is set down with: its support beyond its own weight. A
    person's limits hold for what presses on a limb and for what is fixed and the limb is pressed
    against; an obstacle's for what the machine presses on it with.
    """

    def __init__(
        self, settings: ScenarioSettings, run: Run, placed: tuple[PlacedObject, ...]
    ) -> None:
        hold = round(settings.hold_s * run.rate_hz)
        self.mistakes = Mistakes()
        self._watched = [
            Watched(
                thing,
                part,
                "body" if thing.kind == "body" else "object",
                against,
                run.state.index(f"scene.{thing.name}.{word}.{part}"),
                _support(run, thing),
                limit,
                Episode(limit, settings.release, hold),
            )
            for thing in placed
            for part, limit in thing.limits.items()
            for word, against in ((("force", MOVING), ("hit", FIXED))[: 1 + thing.jointed])
        ]
        pressing = [each for each in run.state.signals if each.name == "contact.fixed"]
        self._links = pressing[0].components if pressing else ()
        self._pressing = run.state.find("contact.fixed") if pressing else None
        self._overload = run.state.find("joint.overload")
        self._names = run.machine.names
        self._over = [0] * len(self._names)
        columns = run.state.columns
        self._drops_at = columns.index("grip.drops") if "grip.drops" in columns else None
        self._drops = 0.0

    @property
    def peaks(self) -> Mapping[str, float]:
        """Largest force so far on objects and on bodies, in N."""
        found = {"object": 0.0, "body": 0.0}
        for each in self._watched:
            found[each.kind] = max(found[each.kind], each.episode.peak)
        return found

    def see(self, state: FloatArray, due: float) -> Iterator[Event]:
        """Take a tick; yield what went wrong in it."""
        yield from self._contacts(state, due)
        yield from self._overloads(state, due)
        if self._drops_at is not None and state.item(self._drops_at) > self._drops:
            self._drops = state.item(self._drops_at)
            yield Event("drop", due, {"count": self.mistakes.add("drop")})

    def _contacts(self, state: FloatArray, due: float) -> Iterator[Event]:
        for each in self._watched:
            force = state.item(each.place)
            if each.support is not None:
                force = max(force, state.item(each.support) - each.thing.mass * GRAVITY)
            if each.episode.see(force):
                count = self.mistakes.add(each.kind)
                about: dict[str, Value] = {
                    "thing": each.thing.name,
                    "part": each.part,
                    "force": force,
                    "limit": each.limit,
                }
                if each.thing.kind == "obstacle":
                    about["link"] = self._pressing_link(state)
                elif each.thing.jointed:
                    about["against"] = each.against
                yield Event(f"contact.{each.kind}", due, {**about, "count": count})

    def _pressing_link(self, state: FloatArray) -> str:
        """Return the link of the machine that presses most on what is fixed."""
        if self._pressing is None:
            return ""
        return self._links[int(state[self._pressing].argmax())]

    def _overloads(self, state: FloatArray, due: float) -> Iterator[Event]:
        for joint, now in enumerate(state[self._overload].tolist()):
            direction = int(now)
            if direction and direction != self._over[joint]:
                kind = "overload_max" if direction > 0 else "overload_min"
                count = self.mistakes.add(kind)
                about: dict[str, Value] = {"joint": self._names[joint], "direction": direction}
                yield Event("overload", due, {**about, "count": count})
            self._over[joint] = direction


def _support(run: Run, thing: PlacedObject) -> int | None:
    return run.state.index(f"scene.{thing.name}.support") if thing.kind == "object" else None
