"""Factors of a study as its report sees them: group, phase, place in it, distance, side."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from labcrane.analysis.quality import is_result

if TYPE_CHECKING:
    import pandas as pd

GROUP, PHASE, PLACE = "group", "phase", "place"
SESSION, BLOCK = "of_session", "of_block"
DISTANCE, SIDE = "distance", "far_side"
CONDITION = "condition"
SEQUENCE = "sequence"


@dataclass(frozen=True, slots=True)
class Factors:
    """Factors of a study.

    Attributes
    ----------
    groups
        Of participants, two or more; otherwise empty. Those that are planned, or have people,
        even without movements.
    phases
        Sessions, or blocks where a session has several, in order.
    kind
        Kind of a phase: ``session``, ``block`` or ``phase`` where both vary.
    places
        Positions of pairs of targets in each phase.
    practice
        Whether there was practice.
    targets
        Planned levels of distance and side, where there are several.
    crossed
        Levels of session and block where both vary and each session has the same blocks; they are
        two factors then, and otherwise phases are one.
    conditions
        Within participants, two or more, in any order; otherwise empty.
    people
        All participants in the sample, even without movements, and their groups.
    uneven
        A sentence if conditions were not equally frequent; empty otherwise.
    """

    groups: tuple[str, ...]
    phases: tuple[str, ...]
    kind: str
    places: dict[str, int]
    practice: bool
    targets: dict[str, tuple[Any, ...]]
    crossed: dict[str, tuple[Any, ...]]
    people: dict[str, str]
    conditions: tuple[str, ...] = ()
    uneven: str = ""

    @property
    def between(self) -> list[str]:
        """Columns of factors between participants."""
        return [GROUP] if self.groups else []

    @property
    def over_phases(self) -> list[str]:
        """Columns of what varies from phase to phase: session and block, or the phase itself."""
        return list(self.crossed) or self.by_phase

    @property
    def by_phase(self) -> list[str]:
        """The column that distinguishes phases, where there are several."""
        return [PHASE] if len(self.phases) > 1 else []

    @property
    def tested(self) -> list[str]:
        """Columns of what tests are over, between participants first and positions last."""
        conditions = [CONDITION] if self.conditions else []
        return [*self.between, *conditions, *self.over_phases, *self.targets, PLACE]

    @property
    def questions(self) -> dict[str, tuple[str, ...]]:
        """The interactions that the design asks about, by name, with their columns.

        With groups, whether what varies within people has another effect in each of them.
        """
        phases = tuple(self.over_phases)
        within: list[tuple[str, ...]] = [(CONDITION,)] if self.conditions else []
        within += [*((name,) for name in phases), *([phases] if len(phases) > 1 else [])]
        asked = [(GROUP, *columns) for columns in within if self.groups]
        return {self.named(":".join(columns)): columns for columns in asked}

    def named(self, effect: str) -> str:
        """Return the name of a column, or of several with colons, as the tables have it."""
        words = {PHASE: self.kind, PLACE: SEQUENCE, SESSION: "session", BLOCK: "block"}
        columns, separator, rest = effect.partition(" ")
        return ":".join(words.get(one, one) for one in columns.split(":")) + separator + rest

    @property
    def unbalanced(self) -> bool:
        """Whether sessions have different blocks, so that phases are one factor of two."""
        return self.kind == "phase" and not self.crossed

    @property
    def alike(self) -> bool:
        """Whether all phases have as many positions, so that positions can be compared."""
        return len(set(self.places.values())) == 1


def with_factors(movements: "pd.DataFrame") -> "pd.DataFrame":
    """Return movements with the columns ``group``, ``phase``, its two parts, and ``place``.

    A phase is a session, or a block where a session has several; a place is the position in it of a
    pair of targets, from 1. So positions of two sessions never merge. ``movements`` must be
    complete, with those excluded from means: a place whose movements all failed is still one.
    """
    table = movements.copy()
    for name in (GROUP, "session_name", "block_name"):
        if name not in table:
            table[name] = ""
    for name, usual in (("session", 1.0), ("block", 1.0), ("practice", 0.0)):
        if name not in table:
            table[name] = usual
    counted = table["practice"].astype(float) == 0.0
    _add_parts(table, counted)
    table[PLACE] = table.groupby(["participant", PHASE])["sequence"].rank(method="dense")
    return table


def _add_parts(table: "pd.DataFrame", counted: "pd.Series[bool]") -> None:
    """Add phase, session and block of each movement by name and order; practice has its own."""
    keys = table[counted].drop_duplicates(["session", "block"]).sort_values(["session", "block"])
    sessions = [own for _, own in keys.groupby("session")]
    several = len(keys) > 1
    parts: dict[tuple[float, float], tuple[str, str, str]] = {}
    for number, blocks in enumerate(sessions, start=1):
        for at, row in enumerate(blocks.to_dict("records"), start=1):
            session, block = str(row["session_name"]), str(row["block_name"])
            words = [session] if len(sessions) > 1 or not several else []
            words += [block or f"block {row['block']:g}"] if len(blocks) > 1 else []
            phase = ", ".join(filter(None, words)) or f"session {row['session']:g}"
            parts[row["session"], row["block"]] = (
                _numbered(len(parts) + 1, len(keys), phase) if several else phase,
                _numbered(number, len(sessions), session or f"session {row['session']:g}"),
                _numbered(at, len(blocks), block or "block"),
            )
    about = zip(table["session"], table["block"], counted, strict=True)
    found = [
        parts[session, block] if is_counted else (f"practice {block:g}", "practice", "practice")
        for session, block, is_counted in about
    ]
    for at, name in enumerate((PHASE, SESSION, BLOCK)):
        table[name] = [each[at] for each in found]


def _numbered(number: int, of: int, name: str) -> str:
    """Return ``02 retention``: names sort by their order."""
    return f"{number:0{len(str(of))}} {name}"


def factors_of(
    table: "pd.DataFrame",
    people: Mapping[str, str] | None = None,
    planned_groups: Collection[str] = (),
) -> Factors:
    """Return the factors of movements :func:`with_factors`.

    Parameters
    ----------
    people
        All participants in the sample, and their groups; by default those with movements.
    planned_groups
        Groups of the protocol; one may have nobody.
    """
    counted = table[table["practice"].astype(float) == 0.0]
    if people is None:
        first = table.drop_duplicates("participant")
        people = dict(zip(map(str, first["participant"]), map(str, first[GROUP]), strict=True))
    groups = tuple(sorted({*counted[GROUP].unique(), *people.values(), *planned_groups} - {""}))
    phases = tuple(sorted(counted[PHASE].unique()))
    sessions = counted["session"].nunique()
    blocks = counted[["session", "block"]].drop_duplicates().groupby("session").size().max()
    kind = "session" if blocks == 1 else "block" if sessions == 1 else "phase"
    places = {str(name): int(own[PLACE].max()) for name, own in counted.groupby(PHASE)}
    several = groups if len(groups) > 1 else ()
    planned = {
        name: tuple(sorted(counted[name].dropna().unique()))
        for name in (DISTANCE, SIDE)
        if name in counted
    }
    targets = {name: levels for name, levels in planned.items() if len(levels) > 1}
    crossed = _crossed(counted)
    practice = len(counted) < len(table)
    own = conditions_in(counted)
    uneven = _uneven(counted[is_result(counted)], own) if own else ""
    return Factors(
        several, phases, kind, places, practice, targets, crossed, dict(people), own, uneven
    )


def conditions_in(table: "pd.DataFrame") -> tuple[str, ...]:
    """Return the movements' conditions within participants, where there are several."""
    if CONDITION not in table:
        return ()
    named = {str(name) for name in table[CONDITION].dropna().unique() if name != ""}
    return tuple(sorted(named)) if len(named) > 1 else ()


def _uneven(results: "pd.DataFrame", conditions: tuple[str, ...]) -> str:
    """Return the first phase in which some conditions had more people than others, in a sentence.

    For those who have results of all conditions, and so are in their test. Plain means of
    conditions then include part of the learning from phase to phase. If all had the same order,
    tests report the confound.
    """
    had = results[results[CONDITION].isin(conditions)]
    had = had.drop_duplicates(["participant", PHASE, CONDITION])
    whole = had.groupby("participant")[CONDITION].nunique() == len(conditions)
    had = had[had["participant"].isin(whole[whole].index)]
    orders = had.sort_values(PHASE).groupby("participant")[CONDITION].agg(tuple)
    if orders.nunique() < 2:  # noqa: PLR2004
        return ""
    for phase, own in had.groupby(PHASE):
        counts = own[CONDITION].value_counts()
        people = [f"{name} for {counts.get(name, 0)}" for name in conditions]
        if counts.nunique() > 1 or len(counts) < len(conditions):
            return (
                f"Conditions were not equally frequent at each place: in {phase}, "
                f"{', '.join(people[:-1])} and {people[-1]} participants; plain means of "
                "conditions include part of the change from place to place, which their tests "
                "take out."
            )
    return ""


def _crossed(counted: "pd.DataFrame") -> dict[str, tuple[Any, ...]]:
    """Return the levels of session and block where each session has the same blocks."""
    blocks = [tuple(sorted(own[BLOCK].unique())) for _, own in counted.groupby(SESSION)]
    if len(blocks) < 2 or len(set(blocks)) > 1 or len(blocks[0]) < 2:  # noqa: PLR2004
        return {}
    return {SESSION: tuple(sorted(counted[SESSION].unique())), BLOCK: blocks[0]}


def running(table: "pd.DataFrame", factors: Factors) -> "pd.DataFrame":
    """Return movements with positions that run on from phase to phase, as figures show them.

    So ``sequence`` names one position in one phase only.
    """
    before, so_far = {}, 0
    for phase in factors.phases:
        before[phase] = so_far
        so_far += factors.places[phase]
    # Without movements, as for a test without participants, the map would be of words.
    return table.assign(sequence=table[PLACE] + table[PHASE].map(before).astype(float))
