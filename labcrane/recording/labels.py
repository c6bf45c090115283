"""Labels of events: plain, few and the same in every session, for programs that epoch by name.

docs/markers.md says how they are made; :data:`KNOWN` says what each means, also in HED.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from labcrane.core.records import UNDONE, Event

LABELS = "labcrane.labels"
"""Name of the stream of labels, live and in exports."""

HED_VERSION = "8.3.0"
"""Version of the HED schema that the tags of labels are from."""

LONGEST = 64
"""Most characters of a level; a longer text is not a level but a scene or a remark."""

BLOCK = ("block", "block_name", "task", "practice")
TRIAL = ("trial", "attempt", *BLOCK, "counted", "group", "reference")
"""Keys of every trial's event in addition to the condition."""


Attempt = tuple[object, object]
"""Number of a trial, and of an attempt at it."""


class Meaning(NamedTuple):
    """Description of a kind of event.

    Attributes
    ----------
    words
        For people.
    hed
        In Hierarchical Event Descriptors, in brackets with a label of its own: tags at the same
        onset are joined, and HED refuses what is said twice.
    """

    words: str
    hed: str


def _tagged(words: str, name: str, *tags: str) -> Meaning:
    return Meaning(words, f"({', '.join((*tags, f'Label/{name_of(name)}'))})")


def name_of(event: str) -> str:
    """Return an event's plain name: ``trial.start`` is ``trial_start``."""
    return event.replace(".", "_")


_STRUCTURE, _CONTROL = "Experiment-structure", "Experiment-control"
_SHOWN = ("Sensory-event", "Visual-presentation")
_MOVED = ("Agent-action", "(Move, Machine)")

KNOWN: Mapping[str, Meaning] = {
    name_of(name): _tagged(words, name, *tags)
    for name, words, *tags in (
        ("session.start", "the session, or a part of it after an interruption, begins", _STRUCTURE),
        ("session.end", "the session has come to its end", _STRUCTURE),
        ("step.start", "a step of the session begins", _STRUCTURE),
        ("step.end", "a step of the session ends", _STRUCTURE),
        ("block.start", "a block of trials begins", _STRUCTURE),
        ("block.end", "a block of trials ends", _STRUCTURE),
        ("trial.start", "a trial begins", _STRUCTURE),
        ("trial.end", "a trial ends", _STRUCTURE),
        ("break.start", "a break begins", _STRUCTURE),
        ("break.end", "a break ends", _STRUCTURE),
        ("judgement.awaited", "the experimenter may judge the test that has ended", _CONTROL),
        ("judgement.over", "the test is judged, and the session goes on", _CONTROL),
        ("pause.start", "the machine is held at rest", _CONTROL),
        ("pause.end", "the session goes on", _CONTROL),
        ("instructions.shown", "instructions are shown", "Sensory-event", "Instructional"),
        ("fixation.shown", "a point to look at is shown", *_SHOWN, "Cue"),
        ("fixation.over", "a point to look at is gone", *_SHOWN),
        ("targets.shown", "the targets are shown", *_SHOWN, "(Target, Circle)"),
        (
            "command.onset", "the operator's hand moves", "Agent-action",
            "Participant-response", "(Move, Hand)",
        ),
        ("movement.onset", "the machine moves", *_MOVED),
        ("movement.offset", "the machine has come to rest", *_MOVED),
        (
            "tap.ignored", "the trigger is pressed before anything has moved", "Agent-action",
            "Participant-response",
        ),
        ("target.entered", "the tip is in the target", "Measurement-event", "(Target, Circle)"),
        ("scene.placed", "the things of a scene are placed", *_SHOWN),
        ("goal.reached", "a goal of the scenario is reached", "Measurement-event"),
        ("contact.object", "the machine touches a thing", "Measurement-event"),
        ("contact.body", "the machine touches a person", "Measurement-event"),
        ("overload", "a thing or a person is pressed too hard", "Measurement-event", "Press"),
        ("drop", "what was held has fallen", "Measurement-event", "Drop"),
        (
            "deformity.reported", "the operator reports a deformity", "Agent-action",
            "Participant-response",
        ),
        ("deformity.found", "a deformity that is there is reported", "Measurement-event"),
        ("questionnaire.start", "a questionnaire is asked", "Sensory-event", "Instructional"),
        ("questionnaire.end", "a questionnaire is submitted", "Agent-action"),
        ("input.lost", "the operator's controls are lost", _CONTROL),
        ("input.back", "the operator's controls are back", _CONTROL),
    )
}  # fmt: skip
"""Labels of labcrane's own events; those of a plugin are made in the same way."""


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
    meanings = {
        name: KNOWN.get(name, _tagged(name.replace("_", " "), name, "Event"))
        for name in sorted(set(names))
    }
    return {
        "LongName": "Event",
        "Description": "plain name of the event",
        "Levels": {name: meaning.words for name, meaning in meanings.items()},
        "HED": {name: meaning.hed for name, meaning in meanings.items()},
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
