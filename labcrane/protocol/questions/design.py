"""Questions about the design: groups, conditions, orders, names."""

import re
from collections.abc import Sequence

from labcrane.errors import ProtocolError
from labcrane.files.pseudonyms import pseudonyms
from labcrane.files.yaml import Place
from labcrane.protocol.design import AS_WRITTEN, CONDITION
from labcrane.protocol.questions.question import (
    Doubts,
    asks,
    blocks_in,
    key_of,
    steps_in,
)
from labcrane.protocol.references import twice
from labcrane.protocol.steps import Block
from labcrane.protocol.study import Study


@asks
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


@asks
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


@asks
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


@asks
def _of_conditions(study: Study) -> Doubts:
    """Question conditions that participants have unequally, or that are confounded with order."""
    design = study.protocol.design
    if not design.conditions:
        return
    at: Place = ("design", "conditions")
    done: dict[int, list[Block]] = {place: [] for place in range(1, design.positions + 1)}
    for _, kind, block in steps_in(study):
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
    meant = {"all": tuple(study.protocol.switched), "none": (), "group": ("the group's",)}
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


@asks
def _of_orders(study: Study) -> Doubts:
    """Question counted blocks that hold a chance part of the levels, or have one order for all."""
    protocol = study.protocol
    unsaid: dict[str, list[str]] = {}
    for place, kind, block in steps_in(study):
        if kind != "block":
            continue
        track = protocol.design.tracks.get(block.track)
        for factor, levels in study.tasks[block.task].factors().items():
            used = min(block.limits.get(factor, len(levels)), len(levels))
            if track is not None and factor == track.factor:
                continue
            if drawn_part(study, block, factor):
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


def drawn_part(study: Study, block: Block, factor: str) -> bool:
    """Return whether each participant does another part of a factor's levels in a block."""
    order = study.protocol.design.order.get(factor, AS_WRITTEN)
    most = block.limits.get(factor)
    levels = len(study.tasks[block.task].factors()[factor])
    if most is None or most >= levels * order.times:
        return False
    # Every repetition holds each level once, but where all are shuffled together.
    whole = order.rule != "shuffled" and most % levels == 0
    return order.rule != AS_WRITTEN.rule and not whole


@asks
def _of_orders_of_blocks(study: Study) -> Doubts:
    """Question blocks of a session that differ and come in one order for everyone."""
    before: dict[int, tuple[int, Block]] = {}
    asked = set()
    for place, kind, block in steps_in(study):
        session, at = int(place[1]), int(place[3])
        if kind != "block" or block.condition is not None or session in asked:
            continue
        first, other = before.setdefault(session, (at, block))
        switches = [
            frozenset(study.protocol.switched) if each.feedback == "all"
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


@asks
def _of_repeats(study: Study) -> Doubts:
    """Question what is listed twice, and groups that are given the same."""
    design = study.protocol.design
    lists: dict[Place, Sequence[str]] = {
        ("design", key, name): given
        for key, some in (("groups", design.groups), ("conditions", design.conditions))
        for name, given in some.items()
        if isinstance(given, tuple)
    }
    for place, block in blocks_in(study):
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


@asks
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
