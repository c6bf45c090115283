"""Labels of events: plain, few and the same in every session, for programs that epoch by name.

docs/markers.md says how they are made; :mod:`labcrane.core.events` says what each means.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from labcrane.core.events import KINDS, EventKind, name_of
from labcrane.core.records import UNDONE, Event

LABELS = "labcrane.labels"
"""Name of the stream of labels, live and in exports."""

LONGEST = 64
"""Most characters of a level; a longer text is not a level but a scene or a remark."""

BLOCK = ("block", "block_name", "task", "practice")
TRIAL = ("trial", "attempt", *BLOCK, "counted", "group", "reference")
"""Keys of every trial's event in addition to the condition."""


Attempt = tuple[object, object]
"""Number of a trial, and of an attempt at it."""


class Labels:
    """Gives each event its label, in the order in which events happen.

    A label is the event's plain name and, within a block, what the block and the trial are about:
    ``trial_start/block=learning/direction=inward``. Only texts and truth values of a condition are
    levels: numbers, as a target's place, would make every label another one.

    Parameters
    ----------
    void
        Trial and attempt of those that are not analysed, as far as that is known by now.
    unseen
        Those in which the operator was shown too little, as far as that is known.
    """

    def __init__(
        self, void: frozenset[Attempt] = frozenset(), unseen: Collection[Attempt] = ()
    ) -> None:
        self._void = void
        self._unseen = unseen
        self._block: tuple[str, ...] = ()
        self._trial: tuple[str, ...] = ()

    def label(self, event: Event) -> str:
        """Return the event's label."""
        return self.of(event.name, event.data)

    def of(self, name: str, data: Mapping[str, Any]) -> str:
        """Return the label of the event ``name``, which says ``data``."""
        if name == "block.start":
            self._block, self._trial = _block(data), ()
        elif name == "trial.start":
            self._trial = self._about(data)
        levels = self._trial or self._block
        if name == "trial.end":
            # The rest of its row is results; of one whose process died, it alone says the trial.
            outcome = plain(str(data.get("outcome", "")))
            asked = {key: value for key, value in data.items() if key != "outcome"}
            levels = self._trial or self._about(asked)
            levels = (*levels, f"outcome={outcome}") if outcome else levels
            self._trial = ()
        elif name == "block.end":
            self._block = self._trial = ()
        elif name in {"session.start", "session.resumed"}:
            levels = self._block = self._trial = ()
        if name in {"signal.bad", "signal.good"}:
            where = {key: str(data[key]) for key in ("stream", "channel", "kind") if data.get(key)}
            levels = (*levels, *(f"{key}={plain(what)}" for key, what in where.items()))
        return "/".join((name_of(name), *levels))

    def _about(self, data: Mapping[str, Any]) -> tuple[str, ...]:
        uncounted = ("uncounted",) if data.get("counted") is False else ()
        void = ("void",) if attempt_of(data) in self._void else ()
        unseen = ("presentation_failed",) if attempt_of(data) in self._unseen else ()
        return (*_block(data), *uncounted, *void, *unseen, *_levels(data))


def labelled(
    events: Sequence[tuple[str, Mapping[str, Any]]], failed: Mapping[Attempt, bool] | None = None
) -> list[str]:
    """Return the labels of a whole session's events, by name and data, in order.

    Attempts that turned out not to be analysed are ``void`` from their start on, and those of which
    the operator was shown too little are ``presentation_failed``.

    Parameters
    ----------
    events
        Name and data of each.
    failed
        Whether an attempt failed so (:func:`labcrane.analysis.presentation_failed`); None where
        this was not examined, as while a session runs.
    """
    labels = Labels(void_attempts(events), {each for each, so in (failed or {}).items() if so})
    return [labels.of(name, data) for name, data in events]


def attempt_of(data: Mapping[Any, Any]) -> Attempt:
    """Return of which trial an event is, and of which attempt at it."""
    return data.get("trial"), data.get("attempt")


def void_attempts(events: Iterable[tuple[str, Mapping[str, Any]]]) -> frozenset[Attempt]:
    """Return the attempts that were broken off, or made again later, by a session's events."""
    last: dict[object, Attempt] = {}
    void = set()
    for name, data in events:
        attempt = attempt_of(data)
        if name == "trial.start":
            if (before := last.get(attempt[0], attempt)) != attempt:
                void.add(before)
            last[attempt[0]] = attempt
        elif name == "trial.end" and data.get("outcome") in UNDONE:
            void.add(attempt)
    return frozenset(void)


def hed_sidecar(names: Iterable[str]) -> dict[str, Any]:
    """Return the description of a column of plain names: words, and HED tags.

    As BIDS and the HED tools have it. Of an event that is not labcrane's own only its name is said.
    """
    known = {kind.label: kind for kind in KINDS.values()}
    kinds = {
        name: known.get(name) or EventKind(name, None, name.replace("_", " "), ("Event",))
        for name in sorted(set(names))
    }
    return {
        "LongName": "Event",
        "Description": "plain name of the event",
        "Levels": {name: kind.meaning for name, kind in kinds.items()},
        "HED": {name: kind.hed for name, kind in kinds.items()},
    }


def plain(text: str) -> str:
    """Return a text in which letters, digits and ``+ - . _`` alone are left; others become _."""
    return "".join(letter if letter.isalnum() or letter in "+-._" else "_" for letter in text)


def _block(data: Mapping[str, Any]) -> tuple[str, ...]:
    name = data.get("block_name") or data.get("block")
    block = (f"block={plain(str(name))}",) if name else ()
    return (*block, *(("practice",) if data.get("practice") else ()))


def _levels(data: Mapping[str, Any]) -> list[str]:
    return [
        f"{plain(key)}={plain(str(value).lower() if isinstance(value, bool) else value)}"
        for key, value in data.items()
        if key not in TRIAL and isinstance(value, str | bool) and len(str(value)) <= LONGEST
    ]
