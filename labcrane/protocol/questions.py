"""Warnings of ``check``: settings that are allowed, but probably a mistake.

Each has a key. A protocol that lists the key under ``expected:`` gets no such warning again.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from labcrane.analysis.presented import operators_views
from labcrane.analysis.scoring.settings import COUNTS, RATINGS, TIME
from labcrane.core.events import KINDS
from labcrane.core.references import Reference, mentioned
from labcrane.core.roles import Controller
from labcrane.core.settings import Within
from labcrane.errors import LabcraneError, ProtocolError, suggestion
from labcrane.files.pseudonyms import pseudonyms
from labcrane.files.system import is_there
from labcrane.files.yaml import Place
from labcrane.protocol.components import ComponentSpec
from labcrane.protocol.design import AS_WRITTEN, CONDITION
from labcrane.protocol.effective import written_numbers
from labcrane.protocol.pages import unserved
from labcrane.protocol.references import twice
from labcrane.protocol.steps import READING_S, Block
from labcrane.protocol.streams import SHARES
from labcrane.protocol.study import Study, trials_of
from labcrane.recording.pictures import RATE_S

_AT = re.compile(r"(.+?):(\d+)(?::(\d+))?: (.*)")

LONGEST_BREAK_S = 3600.0
LONGEST_LATENCY_S = 2.0
LONGEST_SESSION_S = 4 * 3600.0
"""Of a visit that does not say how long it may take."""

ALIKE = 1.2
"""How many times as fast as another a scheme may be before a comparison is of speeds."""

FASTEST_HZ = 1000.0
SLOWEST_HZ = 20.0
REHEARSAL = "rehearsal."
"""Keys of questions that only a rehearsal asks begin with this."""

PLAUSIBLE: Mapping[str, tuple[float, float]] = {
    "m": (1e-5, 1000.0),
    "mm": (1e-2, 1e6),
    "s": (1e-5, 86_400.0),
    "deg": (0.0, 360.0),
    "rad": (0.0, 2 * math.pi),
    "arcmin": (0.0, 21_600.0),
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
    "px": (1.0, 1e5),
    "": (1e-12, 1e12),
}
"""Between which sizes a number of each unit can be meant in a study; 0 always can."""


@dataclass(frozen=True, slots=True)
class CheckQuestion:
    """A warning: the protocol can be run, but contains what is probably a mistake.

    Attributes
    ----------
    key
        The key that answers it under ``expected:``: ``tasks.aiming.limit_s``.
    place
        Where it is in the protocol.
    text
        The warning, with numbers and units.
    """

    key: str
    place: Place
    text: str

    @property
    def whole(self) -> str:
        """The warning, and how to answer it."""
        return f"{self.text} (if it is, write expected: [{self.key}])"


def questions(study: Study) -> tuple[CheckQuestion, ...]:
    """Return the warnings that need an answer before people take part."""
    found = list(dict.fromkeys(_asked(study)))  # of one place there may be several
    asked = {each.key for each in found}
    expected = study.protocol.expected
    stale = [
        CheckQuestion(
            f"expected.{at + 1}",
            ("expected", at),
            f"expected: {key!r} matches no warning; "
            f"{suggestion(key, asked, 'there is') if asked else 'remove it'}",
        )
        for at, key in enumerate(expected)
        if key not in asked and not key.startswith(REHEARSAL)
    ]
    return (*(each for each in found if each.key not in expected), *stale)


Finding = dict[str, Any]
"""One finding of a check, for programs: kind, file, line, column, key, text, the text with the way
to answer a warning, and all of it in one line for people."""


def about(study: Study, question: CheckQuestion) -> Finding:
    """Return the finding of a warning."""
    line, column = study.source.position(question.place) if study.source else (1, 1)
    return {
        "kind": "question",
        "file": str(study.path),
        "line": line,
        "column": column,
        "key": question.key,
        "text": question.text,
        "message": question.whole,
        "whole": f"{study.path}:{line}:{column}: warning: {question.whole}",
    }


def problems(error: LabcraneError) -> list[Finding]:
    """Return a finding for every mistake in an error, which has one a line."""
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


def _asked(study: Study) -> Iterator[CheckQuestion]:
    for place, text in _doubts(study):
        yield CheckQuestion(key_of(place), place, f"{text}; is that meant?")
    yield from _of_the_operator(study)


Doubts = Iterator[tuple[Place, str]]


def _doubts(study: Study) -> Doubts:
    yield from _of_sizes(study)  # first: other warnings about the same number are more specific
    yield from _of_components(study)
    yield from _of_commas(study)
    yield from _of_cut_texts(study)
    yield from _of_the_loop(study)
    yield from _of_feedback(study)
    yield from _of_what_nobody_sees(study)
    yield from _of_slow_views(study)
    yield from _of_what_is_shared(study)
    yield from _of_buttons(study)
    yield from _of_schemes(study)
    yield from _of_monitors(study)
    yield from _of_the_machine(study)
    yield from _of_silent_blocks(study)
    yield from _of_what_groups_are_not_given(study)
    yield from _of_numbers_for_names(study)
    yield from _of_groups(study)
    yield from _of_squares(study)
    yield from _of_conditions(study)
    yield from _of_sessions(study)
    yield from _of_what_counts(study)
    yield from _of_what_is_scored(study)
    yield from _of_orders(study)
    yield from _of_stop_rules(study)
    yield from _of_what_is_not_used(study)
    yield from _of_what_is_not_asked(study)
    yield from _of_orders_of_steps(study)
    yield from _of_orders_of_blocks(study)
    yield from _of_fading(study)
    yield from _of_answers(study)
    yield from _of_streams(study)
    yield from _of_gaze(study)
    yield from _of_pulses(study)
    yield from _of_limits(study)
    yield from _of_repeats(study)
    yield from _of_pattern(study)
    yield from _of_the_pages(study)


def _of_the_pages(study: Study) -> Doubts:
    """Question what is the laboratory's, and not here: a check may be made at another desk."""
    page, folder = study.protocol.page, study.path.parent
    if study.recorded or page.certificate is None or page.key is None:
        return
    files = {"certificate": folder / page.certificate, "key": folder / page.key}
    for key, path in files.items():
        if not is_there(path):
            written = getattr(page, key)
            yield ("page", key), f"page.{key} is {str(written)!r}, which is not on this computer"
    if all(map(is_there, files.values())) and (why := unserved(**files)):
        yield ("page", "certificate"), why


def _of_pattern(study: Study) -> Doubts:
    pattern, planned = study.protocol.participants.pattern, study.protocol.participants.planned
    place: Place = ("participants", "pattern")
    try:
        names = pseudonyms(pattern, planned)
        if not all(re.search("[A-Za-z]", name) for name in names):
            yield (
                place,
                f"the pattern '{pattern}' allows {names[0]}, a number, which consent refuses"
                r"; add a letter, as in P\d{3}",
            )
    except ProtocolError:
        yield (
            place,
            f"the pattern '{pattern}' is not of letters and a number with room for {planned} "
            f"participant{'s' if planned > 1 else ''}, so that plans and simulations can name none",
        )
    if len(re.findall(r"(?<!\\)\{", pattern)) != len(re.findall(r"(?<!\\)\}", pattern)):
        yield place, f"the pattern '{pattern}' has an unpaired brace"


def _of_repeats(study: Study) -> Doubts:
    """Question what is listed twice, and groups that are given the same."""
    design = study.protocol.design
    lists: dict[Place, Sequence[str]] = {
        ("design", key, name): given
        for key, some in (("groups", design.groups), ("conditions", design.conditions))
        for name, given in some.items()
        if isinstance(given, tuple)
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
            again = len(names) - 1 - names[::-1].index(name)
            yield (*place, again), f"{key_of(place)} has {name!r} twice"
    given: dict[frozenset[str], str] = {}
    for name, feedback in design.groups.items():
        if (other := given.setdefault(frozenset(feedback), name)) != name:
            yield (
                ("design", "groups", name),
                f"groups {other!r} and {name!r} are given the same feedback",
            )
    yield from _of_what_is_told(study)


def _of_what_is_told(study: Study) -> Doubts:
    """Question groups, conditions and blocks that give different facts in different forms."""
    design, everything = study.protocol.design, tuple(study.protocol.feedback)
    meant = {"all": everything, "none": (), "group": ()}
    conditions = {
        name: switch if isinstance(switch, tuple) else meant[switch]
        for name, switch in design.conditions.items()
    }
    for key, some in (("groups", design.groups), ("conditions", conditions)):
        yield from _told_apart(
            key,
            {
                ("design", key, name): (repr(name), _facts(study, feedback))
                for name, feedback in some.items()
            },
        )
    for group, own in (design.groups or {"": ()}).items():
        meant["group"] = own
        tasks: dict[str, dict[Place, tuple[str, Facts]]] = {}
        for place, kind, block in _steps(study):
            if kind != "block" or block.condition is not None or not any(block.fading):
                continue
            on = block.feedback if isinstance(block.feedback, tuple) else meant[block.feedback]
            at = f"step {int(place[3]) + 1} of {study.protocol.sessions[int(place[1])].name!r}"
            tasks.setdefault(block.task, {})[place] = at, _facts(study, on)
        for ways in tasks.values():
            yield from _told_apart(f"in group {group!r}, blocks at" if group else "blocks at", ways)


Facts = Mapping[str, float]
"""Largest distance, in metres, at which each fact about the error is shown; infinity without
a limit."""


def _facts(study: Study, feedback: Sequence[str]) -> Facts:
    parts, told = {**study.cues, **study.sounds}, dict[str, float]()
    for name in feedback:
        for each in parts[name].settings.reveals():
            fact, far = (each.fact, each.far) if isinstance(each, Within) else (each, math.inf)
            told[fact] = max(told.get(fact, 0.0), far)
    return told


def _told_apart(what: str, ways: Mapping[Place, tuple[str, Facts]]) -> Doubts:
    """Question each way of feedback, by name and facts, that shows other facts than one before."""
    seen: list[tuple[str, Facts]] = []
    for place, (name, facts) in ways.items():
        if not facts or any(facts == others for _, others in seen):
            continue
        for other, others in seen:
            alone = {other: _only(others, facts), name: _only(facts, others)}
            said = "; ".join(
                f"in {way} alone people learn {each}" for way, each in alone.items() if each
            )
            yield (
                place,
                f"{what} {other} and {name} do not give the same information: {said}; the effect "
                "of the form cannot be distinguished from that of the information",
            )
        seen.append((name, facts))


def _only(facts: Facts, others: Facts) -> str:
    """Return in words the facts that only the first gives, or gives at larger distances."""
    return " and ".join(
        str(Within(fact, far)) if far < math.inf else fact + ", at any distance" * (fact in others)
        for fact, far in sorted(facts.items())
        if others.get(fact) != far
    )


def _of_components(study: Study) -> Doubts:
    for part, choice in study.choices.items():
        place: Place = tuple(part.split(".", 1))
        for key, text in choice.settings.doubts(study.machine).items():
            steps = [int(step) - 1 if step.isdecimal() else step for step in key.split(".")]
            yield (*place, *steps), f"{part}.{key} {text}"
        if part in {f"views.{name}" for name in study.views} and (
            told := choice.settings.reveals()
        ):
            yield (
                place,
                f"{part}: {choice.name} tells {' and '.join(map(str, told))}, in every "
                "group and block; put it under feedback, where the design says who is given it",
            )


def _of_sizes(study: Study) -> Doubts:
    """Question every number of implausible size, in its unit or without one."""
    for each in written_numbers(study):
        least, most = PLAUSIBLE[each.unit]
        said = f"{key_of(each.place)} is {each.value:g} {each.unit}".rstrip()
        if each.value and not least <= abs(each.value) <= most:
            yield each.place, said
        elif (size := each.usual) and each.value:
            if abs(each.value) > size.most:
                yield each.place, f"{said}, and {size.most:g} is very much"
            elif abs(each.value) < size.least:
                yield each.place, f"{said}, and {size.least:g} is very little"


def _of_the_operator(study: Study) -> Iterator[CheckQuestion]:
    """Question an operator that cannot replace the input: nothing can be simulated."""
    if needs_people(study.operator):
        yield CheckQuestion(
            "operator",
            ("operator", "use"),
            f"the operator, {study.operator.name!r}, is a device that a person moves, so the study "
            "can be neither simulated nor rehearsed; is that meant?",
        )
        return
    if lacks := dict.fromkeys(name for _, name in study.beyond_operator):
        place = ("operator",) if "operator" in study.written else study.beyond_operator[0][0]
        yield CheckQuestion(
            "operator",
            place,
            f"the operator, {study.operator.name!r}, which replaces the input in simulations, has "
            f"no {', '.join(lacks)}, so the study can be neither simulated nor rehearsed; is that "
            "meant?",
        )


def needs_people(operator: ComponentSpec) -> bool:
    """Whether the substitute of the input is itself hardware, or a view's keyboard."""
    shown = (each.mark for each in mentioned(operator.settings))
    return operator.offer.examine is not None or any(mark == Reference("view") for mark in shown)


def _of_the_loop(study: Study) -> Doubts:
    rate = study.protocol.rate_hz
    if rate > FASTEST_HZ:
        yield ("rate_hz",), f"rate_hz is {rate:g} Hz, and few computers hold more than 1000 Hz"
    elif rate < SLOWEST_HZ:
        yield ("rate_hz",), f"rate_hz is {rate:g} Hz, at which movements appear to jump"


def _blocks(study: Study) -> Iterator[tuple[Place, Block]]:
    for number, session in enumerate(study.protocol.sessions):
        for at, step in enumerate(session.steps):
            if step.block is not None:
                yield ("sessions", number, "steps", at), step.block


def _of_feedback(study: Study) -> Doubts:
    protocol = study.protocol
    ways = [block.feedback for _, block in _blocks(study) if block.condition is None]
    if any(block.condition is not None for _, block in _blocks(study)):
        ways += protocol.design.conditions.values()
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


SWITCHES = ("all", "none", "group")
"""Values of ``feedback:`` of a step that are not names."""


def _of_what_nobody_sees(study: Study) -> Doubts:
    """Question cues that no view draws for the operator, and feedback called as a switch is."""
    for name in study.protocol.feedback:
        if name in SWITCHES:
            yield (
                ("feedback", name),
                f"feedback is called {name!r}, and feedback: {name} of a step is something else",
            )
    if study.recorded or any("operator" in audience for audience in _audiences(study)):
        return
    for name in study.cues:
        yield (
            ("feedback", name),
            f"feedback {name!r} is drawn in views, and the operator has none, so that nobody sees "
            "it; add one, as views: {operator: {use: view}}",
        )
    for number, session in enumerate(study.protocol.sessions):
        for at, step in enumerate(session.steps):
            if step.kind == "fixation":
                yield (
                    ("sessions", number, "steps", at, "fixation"),
                    f"step {at + 1} of session {session.name!r} has points to be looked at, and "
                    "the operator has no view, so that nobody sees them; add one, as views: "
                    "{operator: {use: view}}",
                )


def _of_slow_views(study: Study) -> Doubts:
    """Question views that are to show fewer pictures than a movement needs to count."""
    limits, folder = study.protocol.presented, study.path.parent
    least = limits.min_hz
    views = {f"views.{name}": choice.described(folder) for name, choice in study.views.items()}
    for name in operators_views(views):
        rate = views[f"views.{name}"]["settings"].get("rate_hz")
        if rate is not None and rate < least:
            yield (
                ("views", name, "rate_hz"),
                f"view {name!r} shows {rate:g} pictures a second, but presented requires "
                f"{least:g}, so no movement counts; write presented: {{min_hz: {rate / 2:g}}}",
            )
    if limits.max_gap_s > RATE_S and operators_views(views):
        yield (
            ("presented", "max_gap_s"),
            f"presented allows {limits.max_gap_s:g} s without a picture, but min_hz requires "
            f"pictures in every {RATE_S:g} s, so {RATE_S:g} s without one excludes a movement; "
            f"write presented: {{max_gap_s: {RATE_S:g}}}",
        )


def _audiences(study: Study) -> Iterator[Sequence[str]]:
    """Yield who sees each view; one that does not say is the operator's."""
    for part, choice in study.choices.items():
        key, _, name = part.partition(".")
        if key == "views" or (key == "feedback" and name not in study.cues):
            given = choice.settings.provides(study.machine)
            yield given.get("audience", ("operator",) if key == "views" else ())


def _of_what_is_shared(study: Study) -> Doubts:
    """Question views that cover each other on one screen, and components that share a port."""
    first: dict[tuple[str, str], str] = {}
    for part, choice in study.choices.items():
        key, _, name = part.partition(".")
        given = choice.settings.provides(study.machine)
        for kind, does in (("screen", "fill"), ("port", "write to")):
            for what in given.get(kind, ()):
                if (other := first.setdefault((kind, what), name)) != name:
                    yield (key, name), f"{key} {other!r} and {name!r} both {does} {kind} {what}"


def _of_buttons(study: Study) -> Doubts:
    """Question a button that the scheme and a task both go by: one press does two things."""
    scheme = study.choices["scheme"].settings
    taken = {
        str(each.value): each.place
        for each in mentioned(scheme)
        if isinstance(each.mark, Reference) and each.mark.kind == "button"
    }
    for part, choice in study.choices.items():
        if part.startswith("tasks."):
            for button in choice.settings.needs(study.machine).get("button", ()):
                if button in taken:
                    yield (
                        tuple(part.split(".", 1)),
                        f"{part} goes by {button!r}, and so does {key_of(taken[button])} of the "
                        "scheme: one press does both",
                    )


def _of_schemes(study: Study) -> Doubts:
    """Question schemes of one study with which the tip cannot be moved alike fast."""
    if len(study.scheme.settings.provides(study.machine).get("scheme", ())) < 2:  # noqa: PLR2004
        return  # most studies have one, and nothing need be built
    scheme = study.scheme.build(study.machine)
    assert isinstance(scheme, Controller)  # noqa: S101 - the registry filed it under its role
    places = [place for task in study.tasks.values() for place in task.places()]
    speeds = scheme.attainable(places)
    if speeds and max(speeds.values()) > ALIKE * min(speeds.values()):
        said = ", ".join(f"{speed:.2f} m/s with {name}" for name, speed in speeds.items())
        yield (
            ("scheme",),
            f"the tip attains {said} at the study's targets (median over targets and directions), "
            "so that a comparison of the schemes finds their speeds; what is not given is worked "
            "out so that they are alike",
        )


def _of_monitors(study: Study) -> Doubts:
    """Question monitors of streams of another type than theirs."""
    for label, need in study.protocol.streams.items():
        choice = study.choices.get(f"monitors.{label}")
        types = choice.settings.provides(study.machine).get("stream type", ()) if choice else ()
        if choice and types and need.type and need.type.lower() not in map(str.lower, types):
            yield (
                ("monitors", label),
                f"monitors.{label} is {choice.name!r}, for streams of type {' or '.join(types)}, "
                f"and streams.{label} is of type {need.type!r}",
            )


FASTEST_JOINT_DEG_S = 360.0
HEAVIEST_LINK_KG = 50_000.0


def _of_the_machine(study: Study) -> Doubts:
    """Question joints that no crane has."""
    for joint, speed in zip(study.machine.joints, study.machine.speeds, strict=True):
        named = f"joint {joint.name!r} of the machine"
        if math.degrees(speed) > FASTEST_JOINT_DEG_S:
            said = f"{named} turns by {math.degrees(speed):.4g} degrees in a second"
            yield _of_joint(study, "speeds_deg_s", joint.name), said
        elif joint.mass_kg > HEAVIEST_LINK_KG:
            said = f"the link of {named} weighs {joint.mass_kg:g} kg"
            yield _of_joint(study, "", joint.name), said


def _of_joint(study: Study, key: str, joint: str) -> Place:
    """Return where the protocol says something of a joint, or names it; else the machine's file."""
    written = study.written.get("machine")
    described = written if isinstance(written, Mapping) else {}
    joints = described.get("joints", ())
    if joint in described.get(key, ()):
        return ("machine", key, joint)
    if isinstance(joints, Mapping):
        return ("machine", "joints", joint)
    return ("machine", "joints", joints.index(joint)) if joint in joints else ("machine",)


def _of_silent_blocks(study: Study) -> Doubts:
    """Question that every group gets all feedback because a block does not specify any."""
    if not (study.protocol.design.groups and study.protocol.feedback):
        return
    all_of_it = ", ".join(study.protocol.feedback)
    for number, session in enumerate(study.protocol.sessions):
        for at, step in enumerate(session.steps):
            if step.block is None or step.block.condition is not None:
                continue
            if "feedback" not in step.block.model_fields_set:
                yield (
                    ("sessions", number, "steps", at),
                    f"sessions: step {at + 1} of {session.name!r} does not say which feedback it "
                    f"has, so that every group is given {all_of_it}; write feedback: group, none, "
                    "all or a list of names",
                )


def _of_what_groups_are_not_given(study: Study) -> Doubts:
    """Question feedback of a step for participants of a group that does not get it.

    This holds for feedback that does not show the error as well: feedback that distinguishes two
    groups is given to one of them only.
    """
    groups = study.protocol.design.groups
    for place, block in _blocks(study):
        if block.feedback in ("group", "none") or "feedback" not in block.model_fields_set:
            continue
        kind = study.protocol.sessions[int(place[1])].steps[int(place[3])].kind
        named = study.protocol.feedback if block.feedback == "all" else block.feedback
        told = {
            name: [repr(group) for group, given in groups.items() if name not in given]
            for name in named
        }
        if said := "; ".join(
            f"{name!r} to {', '.join(without)}" for name, without in told.items() if without
        ):
            yield (
                (*place, kind, "feedback"),
                f"{kind} {int(place[3]) + 1} gives feedback to groups to whom the design does not "
                f"give it, {said}; write feedback: group",
            )


def _of_numbers_for_names(study: Study) -> Doubts:
    """Question levels that a reader of tables takes for numbers or truths: a test has one slope."""
    design = study.protocol.design
    for key, names in (("groups", design.groups), ("conditions", design.conditions)):
        if len(names) > 1 and all(map(_is_guessed, names)):
            yield (
                ("design", key),
                f"the {key} {', '.join(map(repr, names))} are numbers or truths to programs that "
                "guess types of columns, which then test them as one slope; use words",
            )


def _is_guessed(name: str) -> bool:
    try:
        float(name)
    except ValueError:
        return name.lower() in {"t", "f", "true", "false"}
    return True


def _of_groups(study: Study) -> Doubts:
    protocol, groups = study.protocol, study.protocol.design.groups
    if "" in groups:
        yield ("design", "groups"), "a group has no name"
    if len(groups) == 1:
        yield ("design", "groups"), f"{next(iter(groups))!r} is the only group"
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
    factors[CONDITION] = tuple(protocol.design.conditions)
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


def _of_conditions(study: Study) -> Doubts:
    """Question conditions that participants have unequally, or that are confounded with order."""
    design = study.protocol.design
    if not design.conditions:
        return
    at: Place = ("design", "conditions")
    done: dict[int, list[Block]] = {place: [] for place in range(1, design.positions + 1)}
    for _, kind, block in _steps(study):
        if kind == "block" and block.condition is not None:
            done[block.condition].append(block)
    if lacking := [f"{place}" for place, blocks in done.items() if not blocks]:
        yield (
            at,
            f"no block has condition: {', '.join(lacking)}, of {design.positions}, so that each "
            f"participant lacks {'a condition' if len(lacking) == 1 else 'conditions'} of those "
            "that others have",
        )
    same = [
        sorted((each.task, each.repeat, sorted(each.limits.items())) for each in blocks)
        for blocks in done.values()
        if blocks
    ]
    if any(each != same[0] for each in same):
        yield (
            at,
            "the blocks of the conditions differ in task, repeat or levels, so that a condition is "
            "tested with other trials in one position than in another",
        )
    meant = {"all": tuple(study.protocol.feedback), "none": (), "group": ("the group's",)}
    given: dict[frozenset[str], str] = {}
    for name, switch in design.conditions.items():
        feedback = switch if isinstance(switch, tuple) else meant[switch]
        if (other := given.setdefault(frozenset(feedback), name)) != name:
            yield (*at, name), f"conditions {other!r} and {name!r} are given the same feedback"
    if CONDITION not in design.order:
        yield (
            ("design", "order", CONDITION),
            "design has no order for condition, so conditions come in one order for everybody and "
            "their effect cannot be distinguished from learning; write order: {condition: "
            "latin_square}",
        )


def _of_sessions(study: Study) -> Doubts:
    for number, session in enumerate(study.protocol.sessions):
        place: Place = ("sessions", number)
        if number == 0 and session.after_days is not None:
            yield (*place, "after_days"), "after_days of the first session has no session before it"
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


def _steps(study: Study) -> Iterator[tuple[Place, str, Block]]:
    """Yield where each block, practice and reference is, which it is, and its keys."""
    for place, block in _blocks(study):
        kind = study.protocol.sessions[int(place[1])].steps[int(place[3])].kind
        yield (*place, kind), kind, block


def _of_what_counts(study: Study) -> Doubts:
    """Question a study without any results."""
    kinds = dict.fromkeys(kind for _, kind, _ in _steps(study))
    if "block" not in kinds:
        only = f", only {' and '.join(kinds)}, whose trials are not counted" if kinds else ""
        yield (
            ("sessions",),
            f"no session has a block{only}, so a report has no result; write block: "
            "{task: ...} where trials count",
        )
    for name, task in study.tasks.items():
        if not any(trial.counted for trial in task.plan(task.factors())):
            yield ("tasks", name), f"no trial of task {name!r} counts"


def _of_what_is_scored(study: Study) -> Doubts:
    """Question tests of which ``labcrane score`` would leave out the whole, or some points.

    Their columns say that they are scored; by the operator's own reference time in each scenario,
    of the latest reference before them.
    """
    weights = study.protocol.indicator.weights
    rated = [name for part, name in RATINGS.items() if getattr(weights, part)]
    timed: set[str] = set()
    for place, kind, block in _steps(study):
        task = study.tasks[block.task]
        if not {TIME, *COUNTS.values()} <= {name for one in task.results for name in one.columns}:
            continue
        if kind == "reference":
            timed |= _scenarios(study, block, surely=True)
        elif kind == "block":
            here = f"{kind} {int(place[3]) + 1} of session {int(place[1]) + 1}"
            if lacks := _scenarios(study, block, surely=False) - timed:
                of = f" of {', '.join(sorted(lacks))}" if timed and all(lacks) else ""
                yield (
                    (*place, "task"),
                    f"{here} is scored against the operator's own reference time{of}, which no "
                    "earlier step measures, so labcrane score leaves its tests out; write "
                    f"reference: {{task: {block.task}}} before it",
                )
            steps = study.protocol.sessions[int(place[1])].steps[int(place[3]) + 1 :]
            asked = {*block.ask, *(name for step in steps for name in step.questionnaires)}
            if unasked := [name for name in rated if name not in asked]:
                yield (
                    (*place, "ask"),
                    f"{here} is scored by ratings too, and {' and '.join(unasked)} "
                    f"{'is' if len(unasked) == 1 else 'are'} asked neither in it nor after it, so "
                    "that its indicator has no sum; write ask: "
                    f"[{', '.join(rated)}], or give them no weight under indicator",
                )


def _scenarios(study: Study, block: Block, *, surely: bool) -> set[str]:
    """Return the scenarios that all participants do in a block, or that some may; "" for none."""
    task = study.tasks[block.task]
    levels = dict(task.factors())
    for factor, there in levels.items():
        if not _drawn_part(study, block, factor):
            levels[factor] = there[: block.limits.get(factor)]
        elif surely:
            return set()
    return {str(trial.condition.get("scenario") or "") for trial in task.plan(levels)}


def _of_orders(study: Study) -> Doubts:
    """Question counted blocks that hold a chance part of the levels, or have one order for all."""
    protocol = study.protocol
    unsaid: dict[str, list[str]] = {}
    for place, kind, block in _steps(study):
        if kind != "block":
            continue
        track = protocol.design.tracks.get(block.track)
        for factor, levels in study.tasks[block.task].factors().items():
            used = min(block.limits.get(factor, len(levels)), len(levels))
            if track is not None and factor == track.factor:
                continue
            if _drawn_part(study, block, factor):
                yield (
                    (*place, factor),
                    f"the block takes {used} of the {len(levels)} {factor} of {block.task!r}, "
                    f"whose order is {protocol.design.order[factor].rule}: each participant does "
                    "a different part of them, so not everybody meets all levels of this factor; "
                    f"leave {factor} out, give the task fewer levels, or write order: "
                    f"{{{factor}: as_written}} for the same part",
                )
            elif used > 1 and factor not in protocol.design.order:
                unsaid.setdefault(factor, []).append(block.task)
    for factor, tasks in unsaid.items():
        of = ", ".join(map(repr, dict.fromkeys(tasks)))
        yield (
            ("design", "order", factor),
            f"design has no order for {factor} of {of}, so they come as written, in one order for "
            "everybody, and their effect cannot be distinguished from learning; write order: "
            f"{{{factor}: shuffled}} under design",
        )


def _drawn_part(study: Study, block: Block, factor: str) -> bool:
    """Return whether each participant does another part of a factor's levels in a block."""
    order = study.protocol.design.order.get(factor, AS_WRITTEN)
    most = block.limits.get(factor)
    levels = len(study.tasks[block.task].factors()[factor])
    if most is None or most >= levels * order.times:
        return False
    # Every repetition holds each level once, but where all are shuffled together.
    whole = order.rule != "shuffled" and most % levels == 0
    return order.rule != AS_WRITTEN.rule and not whole


def _of_what_is_not_used(study: Study) -> Doubts:
    """Question tasks that no session has, and tracks that choose nothing."""
    protocol = study.protocol
    done = {block.task for _, block in _blocks(study)}
    for name in protocol.tasks:
        if name not in done:
            yield ("tasks", name), f"no session has task {name!r}"
    tracks = {block.track for _, block in _blocks(study)}
    for name in protocol.design.tracks:
        if name not in tracks:
            yield ("design", "tracks", name), f"no block has track {name!r}"


def _of_what_is_not_asked(study: Study) -> Doubts:
    """Question questionnaires that no session asks, and rules that use them."""
    protocol = study.protocol
    asked = {name for _, block in _blocks(study) for name in block.ask}
    asked |= {
        name
        for session in protocol.sessions
        for step in session.steps
        for name in step.questionnaires
    }
    for name in protocol.questionnaires:
        if name not in asked:
            yield ("questionnaires", name), f"no session asks questionnaire {name!r}"
    for number, rule in enumerate(protocol.stop_rules):
        if rule.questionnaire not in asked:
            yield (
                ("stop_rules", number, "questionnaire"),
                f"the rule goes by {rule.questionnaire!r}, which no session asks",
            )
    scores = [f"{rule.questionnaire}.{rule.score}" for rule in protocol.stop_rules]
    for number, score in enumerate(scores):
        if score in scores[:number]:
            yield ("stop_rules", number, "score"), f"a second rule goes by {score}"


def _of_orders_of_steps(study: Study) -> Doubts:
    """Question sessions that ask for consent too late, or end with a break."""
    for number, session in enumerate(study.protocol.sessions):
        kinds = [step.kind for step in session.steps]
        for at, kind in enumerate(kinds):
            place: Place = ("sessions", number, "steps", at)
            if kind == "consent" and any(step.block for step in session.steps[:at]):
                yield (
                    place,
                    f"sessions: step {at + 1} of {session.name!r} asks for consent, after trials",
                )
            if kind == "consent" and kind in kinds[:at]:
                yield place, f"sessions: step {at + 1} of {session.name!r} asks for consent again"
        if kinds[-1] == "break":
            at = len(kinds) - 1
            yield ("sessions", number, "steps", at), f"session {session.name!r} ends with a break"


def _of_orders_of_blocks(study: Study) -> Doubts:
    """Question blocks of a session that differ and come in one order for everyone."""
    before: dict[int, tuple[int, Block]] = {}
    asked = set()
    for place, kind, block in _steps(study):
        session, at = int(place[1]), int(place[3])
        if kind != "block" or block.condition is not None or session in asked:
            continue
        first, other = before.setdefault(session, (at, block))
        switches = [
            frozenset(study.protocol.feedback) if each.feedback == "all"
            else frozenset() if each.feedback == "none"
            else frozenset({"group"}) if each.feedback == "group"
            else frozenset(each.feedback)
            for each in (other, block)
        ]  # fmt: skip
        if other.task != block.task:
            what, way = f"task ({other.task} and {block.task})", ""
        elif switches[0] != switches[1]:
            what = "feedback"
            way = "; write them as design: conditions with order: {condition: latin_square}"
        else:
            continue
        asked.add(session)
        yield (
            (*place, "task" if other.task != block.task else "feedback"),
            f"steps {first + 1} and {at + 1} of {study.protocol.sessions[session].name!r} differ "
            f"in {what} and come in this order for everyone, so its effect cannot be distinguished "
            f"from learning{way}",
        )


def _of_commas(study: Study) -> Doubts:
    """Question lists of numbers in which a comma may be meant as the sign of a decimal."""
    for place, two in study.source.uneven_commas() if study.source else ():
        yield (
            place,
            (
                f"{key_of(place)} has {two} without a space beside commas with one, which are two "
                f"numbers; write {two.replace(',', '.')} if one is meant, or else "
                f"{two.replace(',', ', ')}"
            ),
        )


def _of_cut_texts(study: Study) -> Doubts:
    """Question texts that go on behind a space and a ``#``, which begins a comment."""
    for place, rest in study.source.cut_texts() if study.source else ():
        yield (
            place,
            (
                f"{key_of(place)} ends before {rest!r}, which YAML reads as a comment; put the "
                "text in quotation marks, or write the comment in a line of its own"
            ),
        )


def _of_fading(study: Study) -> Doubts:
    """Question feedback that is to fade over fewer trials than it has parts, or is not there."""
    for place, block in _blocks(study):
        if block.fading == (1.0,):
            continue
        kind = study.protocol.sessions[int(place[1])].steps[int(place[3])].kind
        at = (*place, kind, "fading")
        count = trials_of(block, study.protocol, study.tasks[block.task])[0] / block.repeat
        if block.feedback in ("none", ()):
            yield at, "the feedback fades, and there is none"
        elif count < len(block.fading):
            yield at, f"the feedback fades in {len(block.fading)} parts, over {count:.0f} trials"


MOST_ANSWERS = 300
"""Answers after the trials of one step that give no warning."""


def _of_answers(study: Study) -> Doubts:
    """Question blocks whose questionnaires after each trial ask for very many answers."""
    for place, block in _blocks(study):
        kind = study.protocol.sessions[int(place[1])].steps[int(place[3])].kind
        task = study.tasks[block.task]
        planned = task.plan(task.factors())
        counted = sum(trial.counted for trial in planned) / max(1, len(planned))
        trials = trials_of(block, study.protocol, task)[0] * counted
        each = sum(len(study.questionnaires[name].items()) for name in block.ask)
        if each * trials > MOST_ANSWERS:
            yield (
                (*place, kind, "ask"),
                f"{each} answers after each of {trials:.0f} trials are {each * trials:,.0f} in "
                "all; ask once, in a step of its own, or ask less",
            )


def _of_limits(study: Study) -> Doubts:
    """Question limits of time that fail before they warn, and shares of more than everything."""
    for key, (warn, fail) in study.protocol.sync:
        if warn > fail:
            said = f"sync.{key} warns beyond {warn:g}, and fails beyond {fail:g} already"
            yield ("sync", key), said
        elif key in SHARES and fail > 1.0:
            yield ("sync", key), f"sync.{key} fails beyond {fail:g}, and is a share of 1"


TYPES = ("Audio", "ECG", "EDA", "EEG", "EMG", "Gaze", "GSR", "Markers", "MoCap", "NIRS", "PPG")
"""Types of streams as devices usually write them."""


def _of_streams(study: Study) -> Doubts:
    usual = {each.lower(): each for each in TYPES}
    first: dict[tuple[str | None, ...], str] = {}
    for label, need in study.protocol.streams.items():
        of = (need.type, need.name, need.source_id)
        if "" in of:
            yield ("streams", label), f"streams: {label} is identified by an empty text"
        written = usual.get((need.type or "").lower(), need.type)
        if written != need.type:
            yield (
                ("streams", label, "type"),
                f"streams: {label} is of type {need.type!r}; LSL compares types letter by letter, "
                f"and devices write {written!r}",
            )
        if (other := first.setdefault(of, label)) != label:
            yield ("streams", label), f"streams: {other} and {label} are the same"
        if need.latency_s is not None and abs(need.latency_s) > LONGEST_LATENCY_S:
            yield (
                ("streams", label, "latency_s"),
                f"streams: {label} has a latency of {need.latency_s:g} s",
            )
        if need.any_of_type:
            yield (
                ("streams", label),
                f"streams: {label} is asked for by its type alone, so that any {need.type} on the "
                "network fits, a neighbour's as well, and each run asks which one is meant; give "
                "the source_id or the name that labcrane streams shows",
            )


def _of_pulses(study: Study) -> Doubts:
    """Question events that are sent as pulses, and are learnt long after they happened."""
    for part, choice in study.others.items():
        for each in mentioned(choice.settings) if part.startswith("triggers.") else ():
            kind = KINDS.get(str(each.value)) if each.mark == Reference("event") else None
            if kind is not None and kind.learnt:
                yield (
                    (*part.split(".", 1), *each.place),
                    f"{part} sends {each.value} as a pulse, and a session learns of it only "
                    f"{kind.learnt}, which may be seconds later; use the labels "
                    "and the participant file, whose timestamps are right, and remove it here",
                )


def _of_gaze(study: Study) -> Doubts:
    """Question gaze of which nothing can be measured: in no known space, or of two trackers."""
    needs = study.protocol.streams
    for label, need in needs.items():
        if "gaze" in f"{need.type} {need.name}".lower() and need.space is None:
            yield (
                ("streams", label, "space"),
                f"streams: {label} does not say what its pixels are of, and without a "
                "coordinate_system in its header no gaze is measured by it; write space: screen "
                "for the participant's window, or space: scene for a head-mounted tracker's camera",
            )
    shown = [label for label, need in needs.items() if need.space == "screen"]
    if len(shown) > 1:
        yield (
            ("streams", shown[1], "space"),
            f"streams: {' and '.join(shown)} are all places in the participant's window, so that "
            "a report measures gaze by none of them",
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
