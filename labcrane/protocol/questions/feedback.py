"""Questions about feedback: who gets it, who sees it, and what it tells."""

import math
from collections.abc import Iterator, Mapping, Sequence

from labcrane.analysis.presented import operators_views
from labcrane.core.references import Reference, mentioned
from labcrane.core.settings import Within
from labcrane.core.signals import Signal
from labcrane.files.yaml import Place
from labcrane.protocol.components import ComponentSpec
from labcrane.protocol.protocol import ASSIST
from labcrane.protocol.questions.question import (
    Doubts,
    asks,
    blocks_in,
    steps_in,
)
from labcrane.protocol.study import Study, trials_of
from labcrane.recording.pictures import RATE_S

SWITCHES = ("all", "none", "group")
"""Values of ``feedback:`` of a step that are not names."""

OF_THE_INPUT = (Reference("axis", signed=True), Reference("button"))
"""Marks of settings that name an axis or a button of the input."""

Facts = Mapping[str, float]
"""Largest distance, in metres, at which each fact about the error is shown; infinity without
a limit."""


@asks
def _of_feedback(study: Study) -> Doubts:
    protocol = study.protocol
    ways = [block.feedback for _, block in blocks_in(study) if block.condition is None]
    if any(block.condition is not None for _, block in blocks_in(study)):
        ways += protocol.design.conditions.values()
    used = {name for way in ways if isinstance(way, tuple) for name in way}
    if "group" in ways:
        used |= {name for names in protocol.design.groups.values() for name in names}
    elif protocol.design.groups and protocol.switched:
        yield ("design", "groups"), "no block has feedback: group, so that the groups do the same"
    if "all" in ways:
        return
    for name in protocol.switched:
        if name not in used:
            key = "secondary" if name in protocol.secondary else "feedback"
            at: Place = (key, name)
            if protocol.assist and name in protocol.assist.levels:
                if any(track.factor == ASSIST for track in protocol.design.tracks.values()):
                    continue
                key, at = "share", (ASSIST, "share", name)
            yield at, f"{key} {name!r} is never switched on"


@asks
def _of_what_presents(study: Study) -> Doubts:
    """Question a secondary task without what presents it, and what presents one that is off."""
    shown = {
        name: {str(of).partition(".")[0] for _, of in choice.settings if isinstance(of, str)}
        for name, choice in (study.cues | study.sounds).items()
    }
    presented = {of for all_of in shown.values() for of in all_of} & {*study.secondary}
    for place, names in _switched_together(study):
        for name in names:
            if name in presented and not any(name in shown.get(one, ()) for one in names):
                yield (
                    place,
                    f"{name!r} is on without a feedback that presents it; add one of "
                    f"{', '.join(sorted(one for one in shown if name in shown[one]))}",
                )
            for of in shown.get(name, set()) & {*study.secondary} - {*names}:
                yield place, f"{name!r} presents {of!r}, which is off; add {of}, or leave it out"
    for name in {*study.secondary} - presented:
        if any(signal.name == f"{name}.stimulus" for signal in _signals(study)):
            yield ("secondary", name), f"no feedback presents {name}.stimulus; add one with it"


@asks
def _of_what_responds(study: Study) -> Doubts:
    """Question a response that moves the machine as well."""
    moving = _axes(study, study.scheme)
    for name, choice in study.secondary.items():
        for axis in sorted(_axes(study, choice) & moving):
            yield (
                ("secondary", name),
                f"{name!r} uses {axis}, which moves the machine, too; use a button or a pedal",
            )


def _axes(study: Study, choice: ComponentSpec) -> set[str]:
    """Return the axes of the input that a component names, written or by default."""
    needed = choice.settings.needs(study.machine)
    named = [
        *(str(each.value) for each in mentioned(choice.settings) if each.mark in OF_THE_INPUT),
        *(name for kind in ("axis", "button") for name in needed.get(kind, ())),
    ]
    return {name.removeprefix("-") for name in named}


def _switched_together(study: Study) -> Iterator[tuple[Place, Sequence[str]]]:
    """Yield the lists of what is on together, and where each is written."""
    for key in ("conditions", "groups"):
        for name, on in getattr(study.protocol.design, key).items():
            if isinstance(on, tuple):
                yield ("design", key, name), on
    for place, block in blocks_in(study):
        if isinstance(block.feedback, tuple):
            yield (*place, "feedback"), block.feedback


def _signals(study: Study) -> Iterator[Signal]:
    for task in study.tasks.values():
        yield from task.signals


@asks
def _of_what_nobody_sees(study: Study) -> Doubts:
    """Question cues that no view draws for the operator, and feedback called as a switch is."""
    for name in study.protocol.switched:
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


@asks
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


@asks
def _of_silent_blocks(study: Study) -> Doubts:
    """Question that every group gets all feedback because a block does not specify any."""
    if not (study.protocol.design.groups and study.protocol.switched):
        return
    all_of_it = ", ".join(study.protocol.switched)
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


@asks
def _of_what_groups_are_not_given(study: Study) -> Doubts:
    """Question feedback of a step for participants of a group that does not get it.

    This holds for feedback that does not show the error as well: feedback that distinguishes two
    groups is given to one of them only.
    """
    groups = study.protocol.design.groups
    for place, block in blocks_in(study):
        if block.feedback in ("group", "none") or "feedback" not in block.model_fields_set:
            continue
        kind = study.protocol.sessions[int(place[1])].steps[int(place[3])].kind
        named = study.protocol.switched if block.feedback == "all" else block.feedback
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


@asks
def _of_what_is_told(study: Study) -> Doubts:
    """Question groups, conditions and blocks that give different facts in different forms."""
    design, everything = study.protocol.design, tuple(study.protocol.switched)
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
        for place, kind, block in steps_in(study):
            if kind != "block" or block.condition is not None or not any(block.fading):
                continue
            on = block.feedback if isinstance(block.feedback, tuple) else meant[block.feedback]
            at = f"step {int(place[3]) + 1} of {study.protocol.sessions[int(place[1])].name!r}"
            tasks.setdefault(block.task, {})[place] = at, _facts(study, on)
        for ways in tasks.values():
            yield from _told_apart(f"in group {group!r}, blocks at" if group else "blocks at", ways)


def _facts(study: Study, feedback: Sequence[str]) -> Facts:
    parts = {**study.cues, **study.sounds, **study.secondary}
    told = dict[str, float]()
    for name in feedback:
        for each in parts[name].settings.reveals() if name in parts else ():
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


@asks
def _of_fading(study: Study) -> Doubts:
    """Question feedback that is to fade over fewer trials than it has parts, or is not there."""
    for place, block in blocks_in(study):
        if block.fading == (1.0,):
            continue
        kind = study.protocol.sessions[int(place[1])].steps[int(place[3])].kind
        at = (*place, kind, "fading")
        count = trials_of(block, study.protocol, study.tasks[block.task])[0] / block.repeat
        if block.feedback in ("none", ()):
            yield at, "the feedback fades, and there is none"
        elif count < len(block.fading):
            yield at, f"the feedback fades in {len(block.fading)} parts, over {count:.0f} trials"
