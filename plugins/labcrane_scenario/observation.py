"""Observation of a scene: forces, overloads, drops, and where everything is."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from labcrane import FloatArray, Run
from labcrane.core import Event, Value
from labcrane.machines import GRAVITY, PlacedObject, segments
from labcrane_scenario.mistakes import ContactEpisode, Mistakes
from labcrane_scenario.settings import ScenarioSettings

SETTLE_S = 0.5
"""Time in seconds in which a casualty, placed a little above the ground, settles on it."""

SUPPORTED_M = 0.02
"""Something that slipped and fell by no more than this, in metres, was set down or supported."""

GRIP = ("height", "loose", "slipped", "left")
"""Entries of the state about a thing that leaves the jaws."""


@dataclass(frozen=True, slots=True)
class Watched:
    """One limited part of a thing, and where a force on it sits in the state.

    Attributes
    ----------
    kind
        Of the mistake: an obstacle is an object too.
    against
        What presses, as far as the scene knows: what moves, what is fixed, or the ground.
    rest
        Force that is none of its own doing, in N: what the part weighs that lies on the ground.
    """

    thing: PlacedObject
    part: str
    kind: str
    against: str
    place: int
    support: int | None
    limit: float
    episode: ContactEpisode
    rest: float = 0.0


MOVING, FIXED, GROUND = "moving", "fixed", "ground"


class Observation:
    """Observe one trial's scene, and report mistakes as events.

    An object's limit also holds for what it is set down with: its support beyond its own weight,
    once for the whole of it, by the limit of its first part. A
    person's limits hold for what presses on a limb and for what is fixed and the limb is pressed
    against; those of the ground for how hard it lands on what it lies on, beyond its weight. An
    obstacle's hold for what the machine presses on it with.
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
                _support(run, thing) if part == next(iter(thing.limits)) else None,
                limit,
                ContactEpisode(limit, settings.release, hold),
            )
            for thing in placed
            for part, limit in thing.limits.items()
            for word, against in ((("force", MOVING), ("hit", FIXED))[: 1 + thing.jointed])
        ]
        self._grounded = [
            watched for thing in placed for watched in _grounds(settings, run, thing, hold)
        ]
        self._settling = round(SETTLE_S * run.rate_hz)
        pressing = [each for each in run.state.signals if each.name == "contact.fixed"]
        self._links = pressing[0].components if pressing else ()
        self._pressing = run.state.find("contact.fixed") if pressing else None
        self._overload = run.state.find("joint.overload")
        self._names = run.machine.names
        self._over = [0] * len(self._names)
        self._grip = (
            {word: run.state.index(f"grip.{word}") for word in GRIP}
            if "grip.left" in run.state.columns
            else {}
        )
        self._drop_m = settings.drop_m
        self._left, self._loose = 0.0, 0
        moving = [each.name.split(".")[1] for each in run.state.signals if _says_support(each.name)]
        self._moving = ("", *moving)

    @property
    def peaks(self) -> Mapping[str, float]:
        """Largest force so far on objects and on bodies, in N."""
        found = {"object": 0.0, "body": 0.0}
        for each in (*self._watched, *self._grounded):
            found[each.kind] = max(found[each.kind], each.episode.peak)
        return found

    def see(self, state: FloatArray, due: float) -> Iterator[Event]:
        """Take a tick; yield its mistakes."""
        yield from self._contacts(state, due)
        yield from self._overloads(state, due)
        yield from self._dropped(state, due)

    def end(self, state: FloatArray, due: float) -> Iterator[Event]:
        """Yield the drop of a thing that leaves the jaws in the trial's last tick."""
        if self._loose:
            yield from self._fallen(state, due)

    def _dropped(self, state: FloatArray, due: float) -> Iterator[Event]:
        """Yield the drop of a thing that left the jaws and fell too far."""
        if not self._grip:
            return
        left = state.item(self._grip["left"])
        if left > self._left:
            yield from self._fallen(state, due)
        self._left, self._loose = left, int(state.item(self._grip["loose"]))

    def _fallen(self, state: FloatArray, due: float) -> Iterator[Event]:
        height = state.item(self._grip["height"])
        slipped = state.item(self._grip["slipped"]) > 0.0
        if height > (SUPPORTED_M if slipped else self._drop_m):
            about: dict[str, Value] = {
                "thing": self._moving[self._loose],
                "height": height,
                "slipped": slipped,
            }
            yield Event("drop", due, {"count": self.mistakes.add("drop"), **about})

    def _contacts(self, state: FloatArray, due: float) -> Iterator[Event]:
        lies = self._settling == 0
        self._settling = max(0, self._settling - 1)
        for each in (*self._watched, *(self._grounded if lies else ())):
            force = state.item(each.place) - each.rest
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
        """Return the link of the machine with the largest force on fixed things."""
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


def _grounds(
    settings: ScenarioSettings, run: Run, thing: PlacedObject, hold: int
) -> Iterator[Watched]:
    """Yield an observer of each part of a casualty that measures how hard it lands."""
    signal = f"scene.{thing.name}.ground"
    if not any(each.name == signal for each in run.state.signals):
        return
    weight = {each.parts[0].name: each.mass * GRAVITY for each in segments(thing)}
    for part, limit in thing.ground.items():
        yield Watched(
            thing,
            part,
            "body",
            GROUND,
            run.state.index(f"{signal}.{part}"),
            None,
            limit,
            ContactEpisode(limit, settings.release, hold),
            weight[part],
        )


def _says_support(name: str) -> bool:
    return name.startswith("scene.") and name.endswith(".support")


def _support(run: Run, thing: PlacedObject) -> int | None:
    return run.state.index(f"scene.{thing.name}.support") if thing.kind == "object" else None
