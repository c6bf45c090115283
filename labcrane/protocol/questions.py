"""Questions: what a protocol may say, and hardly anybody means.

Each has a key, which a protocol answers under ``expected:``; then it is not asked again.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from labcrane.errors import LabcraneError, ProtocolError, suggestion
from labcrane.files.pseudonyms import pseudonyms
from labcrane.files.system import is_there
from labcrane.files.yaml import Place
from labcrane.protocol.effective import written_numbers
from labcrane.protocol.references import twice
from labcrane.protocol.steps import READING_S, Block
from labcrane.protocol.study import Study, trials_of

_AT = re.compile(r"(.+?):(\d+)(?::(\d+))?: (.*)")

LONGEST_BREAK_S = 3600.0
LONGEST_SESSION_S = 4 * 3600.0
"""Of a visit that does not say how long it may take."""

FASTEST_HZ = 1000.0
SLOWEST_HZ = 20.0
REHEARSAL = "rehearsal."
"""Keys of questions that only a rehearsal asks begin with this."""

PLAUSIBLE: Mapping[str, tuple[float, float]] = {
    "m": (1e-5, 1000.0),
    "s": (1e-5, 86_400.0),
    "deg": (0.0, 360.0),
    "rad": (0.0, 2 * math.pi),
    "Hz": (1e-3, 1e6),
    "kg": (1e-3, 1e5),
    "N": (1e-3, 1e7),
    "N m": (1e-3, 1e7),
    "m/s": (1e-5, 50.0),
    "deg/s": (1e-3, 720.0),
    "1/s": (1e-3, 1000.0),
    "day": (0.0, 3650.0),
    "ppm": (0.0, 1e6),
    "uV": (1e-3, 1e6),
    "": (1e-12, 1e12),
}
"""Between which sizes a number of each unit can be meant in a study; 0 always can."""


@dataclass(frozen=True, slots=True)
class Question:
    """Something that can be run, and is hardly meant.

    Attributes
    ----------
    key
        By which ``expected:`` answers it: ``tasks.aiming.limit_s``.
    place
        Where it is in the protocol.
    text
        What is asked, with numbers and units.
    """

    key: str
    place: Place
    text: str

    @property
    def whole(self) -> str:
        """The question, and how it is answered."""
        return f"{self.text} (if it is, write expected: [{self.key}])"


def questions(study: Study) -> tuple[Question, ...]:
    """Return what should be asked before people take part, and has not been answered."""
    asked = {each.key: each for each in _asked(study)}
    expected = study.protocol.expected
    stale = [
        Question(
            f"expected.{at + 1}",
            ("expected", at),
            f"expected has {key!r}, which nothing asks; "
            f"{suggestion(key, asked, 'asked is') if asked else 'leave it out'}",
        )
        for at, key in enumerate(expected)
        if key not in asked and not key.startswith(REHEARSAL)
    ]
    return (*(each for key, each in asked.items() if key not in expected), *stale)


Finding = dict[str, Any]
"""What a check tells a program of one finding: kind, file, line, column, key, text, the text with
what answers a question, and all in one line as people read it."""


def about(study: Study, question: Question) -> Finding:
    """Return what is told of a question."""
    line, column = study.source.position(question.place) if study.source else (1, 1)
    return {
        "kind": "question",
        "file": str(study.path),
        "line": line,
        "column": column,
        "key": question.key,
        "text": question.text,
        "message": question.whole,
        "whole": f"{study.path}:{line}:{column}: question: {question.whole}",
    }


def problems(error: LabcraneError) -> list[Finding]:
    """Return what is told of every mistake in an error, one a line."""
    found = []
    for whole in str(error).splitlines():
        at = _AT.match(whole)
        file, line, column, text = at.groups() if at else ("", None, None, whole)
        found.append(
            {
                "kind": "problem",
                "file": file,
                "line": int(line or 1),
                "column": int(column or 0),
                "key": "",
                "text": text,
                "message": text,
                "whole": whole,
            }
        )
    return found


def key_of(place: Sequence[str | int]) -> str:
    """Return the key of a question about a place; items count from 1."""
    return ".".join(str(step + 1) if isinstance(step, int) else step for step in place)


def _asked(study: Study) -> Iterator[Question]:
    for place, text in _doubts(study):
        yield Question(key_of(place), place, f"{text}; is that meant?")
    yield from _of_the_operator(study)


Doubts = Iterator[tuple[Place, str]]


def _doubts(study: Study) -> Doubts:
    yield from _of_components(study)
    yield from _of_sizes(study)
    yield from _of_the_loop(study)
    yield from _of_feedback(study)
    yield from _of_silent_blocks(study)
    yield from _of_groups(study)
    yield from _of_squares(study)
    yield from _of_sessions(study)
    yield from _of_stop_rules(study)
    yield from _of_streams(study)
    yield from _of_repeats(study)
    yield from _of_pattern(study)
    yield from _of_the_pages(study)


def _of_the_pages(study: Study) -> Doubts:
    """Question what is the laboratory's, and not here: a check may be made at another desk."""
    page = study.protocol.page
    for key, path in (("certificate", page.certificate), ("key", page.key)):
        if path is not None and not study.recorded and not is_there(study.path.parent / path):
            yield (
                ("page", key),
                f"page.{key} is {str(path)!r}, which is not on this computer",
            )


def _of_pattern(study: Study) -> Doubts:
    pattern, planned = study.protocol.participants.pattern, study.protocol.participants.planned
    place: Place = ("participants", "pattern")
    try:
        pseudonyms(pattern, planned)
    except ProtocolError:
        yield (
            place,
            f"the pattern {pattern!r} is not of letters and a number with room for {planned} "
            f"participant{'s' if planned > 1 else ''}, so that plans and simulations can name none",
        )
    if len(re.findall(r"(?<!\\)\{", pattern)) != len(re.findall(r"(?<!\\)\}", pattern)):
        yield place, f"the pattern {pattern!r} has a brace that stands alone"


def _of_repeats(study: Study) -> Doubts:
    """Question what is listed twice, and groups that are given the same."""
    lists: dict[Place, Sequence[str]] = {
        ("design", "groups", name): given for name, given in study.protocol.design.groups.items()
    }
    for place, block in _blocks(study):
        kind = study.protocol.sessions[int(place[1])].steps[int(place[3])].kind
        lists[*place, kind, "ask"] = block.ask
        if isinstance(block.feedback, tuple):
            lists[*place, kind, "feedback"] = block.feedback
    for number, session in enumerate(study.protocol.sessions):
        for at, step in enumerate(session.steps):
            lists["sessions", number, "steps", at, "questionnaire"] = step.questionnaires
    for place, names in lists.items():
        for name in twice(names):
            yield place, f"{key_of(place)} has {name!r} twice"
    given: dict[frozenset[str], str] = {}
    for name, feedback in study.protocol.design.groups.items():
        if (other := given.setdefault(frozenset(feedback), name)) != name:
            yield (
                ("design", "groups", name),
                f"groups {other!r} and {name!r} are given the same feedback",
            )


def _of_components(study: Study) -> Doubts:
    for part, choice in study.choices.items():
        place: Place = tuple(part.split(".", 1))
        for key, text in choice.settings.doubts(study.machine).items():
            yield (*place, *key.split(".")), f"{part}.{key} {text}"
        for warning in choice.settings.warnings():
            yield place, f"{part}: {warning}"
        if part in {f"views.{name}" for name in study.views} and (
            told := choice.settings.reveals()
        ):
            yield (
                place,
                f"{part}: {choice.name} tells {told}, in every group and block; put it under "
                "feedback, where the design says who is given it",
            )


def _of_sizes(study: Study) -> Doubts:
    """Question every number that nobody would write, in its unit or without one."""
    for each in written_numbers(study):
        least, most = PLAUSIBLE[each.unit]
        if each.value and not least <= abs(each.value) <= most:
            yield each.place, f"{key_of(each.place)} is {each.value:g} {each.unit}".rstrip()


def _of_the_operator(study: Study) -> Iterator[Question]:
    """Question an operator who cannot stand in for the input: nothing can be simulated."""
    if lacks := dict.fromkeys(name for _, name in study.beyond_operator):
        place = ("operator",) if "operator" in study.written else study.beyond_operator[0][0]
        yield Question(
            "operator",
            place,
            f"the operator, {study.operator.name!r}, who stands in for the input when nobody is "
            f"there, has no {', '.join(lacks)}, so that the study can be neither simulated nor "
            "rehearsed; is that meant?",
        )


def _of_the_loop(study: Study) -> Doubts:
    rate = study.protocol.rate_hz
    if rate > FASTEST_HZ:
        yield ("rate_hz",), f"rate_hz is {rate:g} Hz, and few computers hold more than 1000 Hz"
    elif rate < SLOWEST_HZ:
        yield ("rate_hz",), f"rate_hz is {rate:g} Hz, at which a movement is seen to jump"


def _blocks(study: Study) -> Iterator[tuple[Place, Block]]:
    for number, session in enumerate(study.protocol.sessions):
        for at, step in enumerate(session.steps):
            if step.block is not None:
                yield ("sessions", number, "steps", at), step.block


def _of_feedback(study: Study) -> Doubts:
    protocol = study.protocol
    ways = [block.feedback for _, block in _blocks(study)]
    used = {name for way in ways if isinstance(way, tuple) for name in way}
    if "group" in ways:
        used |= {name for names in protocol.design.groups.values() for name in names}
    elif protocol.design.groups and protocol.feedback:
        yield ("design", "groups"), "no block has feedback: group, so that the groups do the same"
    if "all" in ways:
        return
    for name in protocol.feedback:
        if name not in used:
            yield ("feedback", name), f"feedback {name!r} is never switched on"


def _of_silent_blocks(study: Study) -> Doubts:
    """Question that every group is given all feedback because a block says nothing of it."""
    if not (study.protocol.design.groups and study.protocol.feedback):
        return
    all_of_it = ", ".join(study.protocol.feedback)
    for number, session in enumerate(study.protocol.sessions):
        for at, step in enumerate(session.steps):
            if step.block is not None and "feedback" not in step.block.model_fields_set:
                yield (
                    ("sessions", number, "steps", at),
                    f"sessions: step {at + 1} of {session.name!r} does not say which feedback it "
                    f"has, so that every group is given {all_of_it}; write feedback: group, none, "
                    "all or a list of names",
                )


def _of_groups(study: Study) -> Doubts:
    protocol, groups = study.protocol, study.protocol.design.groups
    if not groups or "planned" not in protocol.participants.model_fields_set:
        return
    planned, place = protocol.participants.planned, ("participants", "planned")
    if planned < len(groups):
        yield place, f"{planned} planned, of {len(groups)} groups: some have no participants"
    elif planned % len(groups):
        yield (
            place,
            f"{planned} planned are not balanced over {len(groups)} groups; a multiple of "
            f"{len(groups)} is",
        )


def _of_squares(study: Study) -> Doubts:
    protocol = study.protocol
    if "planned" not in protocol.participants.model_fields_set:
        return
    groups = max(1, len(protocol.design.groups))
    factors = {name: seen for task in study.tasks.values() for name, seen in task.factors().items()}
    for factor, order in protocol.design.order.items():
        n = len(factors.get(factor, ()))
        if order.rule not in {"latin_square", "williams"} or n < 2:  # noqa: PLR2004 - no order
            continue
        rows = 2 * n if order.rule == "williams" and n % 2 else n
        if protocol.participants.planned % (rows * groups):
            yield (
                ("design", "order", factor),
                f"{protocol.participants.planned} planned do not balance the {order.rule} of "
                f"{factor}, which has {rows} rows; a multiple of {rows * groups} does",
            )


def _of_sessions(study: Study) -> Doubts:
    for number, session in enumerate(study.protocol.sessions):
        place: Place = ("sessions", number)
        if number == 0 and session.after_days is not None:
            yield (*place, "after_days"), "after_days of the first session counts from no other"
        long = 0.0
        for at, step in enumerate(session.steps):
            if step.kind == "break" and step.seconds > LONGEST_BREAK_S:
                about = f"a break of {step.seconds / 3600:.3g} hours"
                yield (*place, "steps", at, "break", "seconds"), about
            long += step.seconds if step.kind == "break" else READING_S
            if step.block is not None:
                task = study.tasks[step.block.task]
                count, seconds = trials_of(step.block, study.protocol, task)
                long += seconds - READING_S
                until = step.block.until
                if until is not None and until.successes > count:
                    yield (
                        (*place, "steps", at, "practice", "until", "successes"),
                        f"practice is enough after {until.successes} successes in a row, and has "
                        f"{count:.0f} trials at most",
                    )
        likely = f"session {session.name!r} is likely to take {_duration(long)}"
        if session.window_s is not None and long > session.window_s:
            yield (*place, "window_s"), f"{likely}, and may take {_duration(session.window_s)}"
        elif session.window_s is None and long > LONGEST_SESSION_S:
            yield place, likely


def _duration(seconds: float) -> str:
    if seconds < 2 * 60.0:
        return f"{seconds:.3g} s"
    if seconds < 2 * 3600.0:
        return f"{seconds / 60:.3g} minutes"
    return f"{seconds / 3600:.3g} hours"


def _of_streams(study: Study) -> Doubts:
    for label, need in study.protocol.streams.items():
        if need.any_of_type:
            yield (
                ("streams", label),
                f"streams: {label} is asked for by its type alone, so that any {need.type} on the "
                "network fits, a neighbour's as well, and each run asks which one is meant; give "
                "the source_id or the name that labcrane streams shows",
            )


def _of_stop_rules(study: Study) -> Doubts:
    for number, rule in enumerate(study.protocol.stop_rules):
        for score in study.questionnaires[rule.questionnaire].scores:
            if score.name == rule.score and not score.lowest <= rule.above < score.highest:
                yield (
                    ("stop_rules", number, "above"),
                    f"{rule.score} is {score.lowest:g} to {score.highest:g}, so that one above "
                    f"{rule.above:g} is {'always' if rule.above < score.lowest else 'never'} there",
                )
