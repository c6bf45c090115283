"""The complete allocation of a study: participants' conditions and orders, and their balance."""

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from labcrane.design.order import SQUARES
from labcrane.design.plan import plan_session
from labcrane.design.squares import carry_over, positions, spread
from labcrane.protocol.design import CONDITION
from labcrane.protocol.study import Study


@dataclass(frozen=True, slots=True)
class Allotment:
    """One block of one participant.

    Attributes
    ----------
    seed
        The participant's seed.
    levels
        The order of each factor's levels.
    condition
        Name of the participant's condition; "" for none.
    """

    participant: str
    slot: int
    group: str
    seed: int
    session: int
    block: int
    name: str
    levels: Mapping[str, tuple[str, ...]]
    condition: str = ""


def allocate(study: Study, participants: Mapping[str, int | None]) -> list[Allotment]:
    """Return the blocks of all participants, given with their slots."""
    return [
        Allotment(name, plan.slot, plan.group, plan.seed, number, block.number, block.name,
                  block.levels, block.condition)
        for name, slot in participants.items()
        for number in range(1, len(study.protocol.sessions) + 1)
        for plan in [plan_session(study, name, number, slot)]
        for block in plan.blocks
    ]  # fmt: skip


def balance(study: Study, allotments: Sequence[Allotment]) -> list[str]:
    """Return the balance of an allocation, line by line.

    A line that begins with ``not balanced`` names the imbalance and what would be balanced.
    """
    lines = _groups(study, allotments)
    for factor, order in study.protocol.design.order.items():
        if order.rule in SQUARES:
            for group in dict.fromkeys(each.group for each in allotments):
                orders = (
                    conditions_in(allotments, group)
                    if factor == CONDITION
                    else _orders(allotments, factor, group)
                )
                lines += _square(factor, order.rule, orders, group)
    return lines


def _groups(study: Study, allotments: Sequence[Allotment]) -> list[str]:
    if not study.protocol.design.groups:
        return []
    members = {each.participant: each.group for each in allotments}
    sizes = Counter(dict.fromkeys(study.protocol.design.groups, 0))
    sizes.update(members.values())
    listed = ", ".join(f"{group} {size}" for group, size in sizes.items())
    if len(set(sizes.values())) == 1:
        return [f"balanced: groups of equal size: {listed}"]
    count = len(sizes)
    return [
        f"not balanced: groups: {listed}; they are equal for a multiple of {count} participants"
    ]


def _orders(allotments: Sequence[Allotment], factor: str, group: str) -> dict[str, tuple[str, ...]]:
    """Return each participant's order of a factor: of the first block that varies it completely."""
    found: dict[str, tuple[str, ...]] = {}
    for each in allotments:
        levels = each.levels.get(factor, ())
        if each.group == group and len(levels) > len(found.get(each.participant, ())):
            found[each.participant] = levels
    return found


def conditions_in(allotments: Sequence[Allotment], group: str) -> dict[str, tuple[str, ...]]:
    """Return the order in which each participant of a group first has conditions."""
    found: dict[str, dict[str, None]] = {}
    for each in allotments:
        if each.group == group and each.condition:
            found.setdefault(each.participant, {})[each.condition] = None
    return {name: tuple(own) for name, own in found.items()}


def _square(factor: str, rule: str, orders: Mapping[str, tuple[str, ...]], group: str) -> list[str]:
    if not orders:
        return []
    where = f"{factor} ({rule}{f', group {group}' if group else ''})"
    whole = max(orders.values(), key=len)
    levels = tuple(dict.fromkeys(whole))
    n, rows = len(levels), len(SQUARES[rule](len(levels)))
    once = [order[:n] for order in orders.values()]
    uneven = spread(positions(once), n * n)
    lines = [
        f"balanced: {where}: every level in every position {len(once) // n} times"
        if uneven == 0
        else f"not balanced: {where}: counts of levels in positions differ by {uneven}; they are "
        f"equal for a multiple of {rows} participants{' per group' if group else ''}"
    ]
    if rule == "williams" and n > 1:
        uneven = spread(carry_over(once), n * (n - 1))
        lines.append(
            f"balanced: {where}: every level follows every other {len(once) // n} times"
            if uneven == 0
            else f"not balanced: {where}: counts of neighbours differ by {uneven}; they are equal "
            f"for a multiple of {rows} participants{' per group' if group else ''}"
        )
    return lines


def as_csv(allotments: Sequence[Allotment]) -> str:
    """Return the allocation as comma-separated values, one row per block and factor."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(
        ["participant", "slot", "group", "seed", "session", "block", "name", "factor", "order"]
    )
    for each in allotments:
        about = [each.participant, each.slot, each.group, each.seed, each.session, each.block]
        said = {CONDITION: (each.condition,)} if each.condition else {}
        for factor, levels in {**said, **each.levels}.items():
            writer.writerow([*about, each.name, factor, " ".join(levels)])
    return out.getvalue()
