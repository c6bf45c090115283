"""Shortfalls of planned tests: what could not be tested, or not with all participants, and why."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

from labcrane.analysis.presented import not_presented
from labcrane.analysis.quality import is_result, is_success
from labcrane.analysis.report.factors import CONDITION, DISTANCE, GROUP, PHASE, PLACE, Factors
from labcrane.analysis.report.outcomes import (
    ADJUSTED,
    SEQUENCE,
    Plan,
    after_conditions,
    measures_in,
    named_factor,
    occasions,
    of_gaze,
    plans,
    practice_words,
    practised,
)
from labcrane.analysis.statistics.anova import LEAST, alone, whole_people, word

if TYPE_CHECKING:
    import pandas as pd

NOTHING = "nothing recorded"

NAMED = 12
"""Participants who are named in a sentence; tables list all."""

SHOWN = 3
"""Cells without a value that are named; the others are only counted."""


@dataclass(frozen=True, slots=True)
class Shortfall:
    """The shortfall of a planned test.

    Attributes
    ----------
    measure, factor
        The measure and the factor, as in the tables of tests.
    without
        The group, level or people missing from the test; empty if there is no test.
    people
        Number in the sample, or in the missing group.
    whole
        Number of them with a value in every cell.
    why
        The reason in words.
    """

    measure: str
    factor: str
    without: str
    people: int
    whole: int
    why: str


@dataclass(frozen=True, slots=True)
class Made:
    """Tests that were made, from the report's tables.

    Attributes
    ----------
    anova, trends, scales, practice, gaze, scores
        Empty if there was none.
    """

    anova: "pd.DataFrame"
    trends: "pd.DataFrame"
    scales: "pd.DataFrame"
    practice: "pd.DataFrame"
    gaze: "pd.DataFrame"
    scores: "pd.DataFrame"


def shortfalls(
    everything: "pd.DataFrame",
    scores: "pd.DataFrame",
    made: Made,
    factors: Factors,
    primary: Sequence[str] = (),
) -> "pd.DataFrame":
    """Return the shortfalls; empty if all tests were made with all participants and levels.

    Parameters
    ----------
    everything
        All movements, with factors.
    scores
        Of questionnaires.
    made
        The tests that were made.
    factors
        The factors, and the sample.
    """
    import pandas as pd

    people, results = factors.people, everything[is_result(everything)]
    found: list[Shortfall] = []
    for measure in measures_in(results, primary):
        tested = _made(made.anova, measure)
        for plan in plans(results, factors):
            found += _of_plan(plan, everything, measure, factors, people, tested)
        found += _of_trends(everything, measure, factors, people, made.trends)
        found += _of_scales(everything, measure, factors, made.scales)
    found += _of_practice(everything, factors, people, made.practice, primary)
    for name in of_gaze(results):
        plan = Plan((*factors.over_phases, DISTANCE))
        found += _of_plan(plan, everything, name, factors, people, _made(made.gaze, name))
    found += _of_scores(scores, made.scores, people)
    return pd.DataFrame([asdict(one) for one in found])


def _of_practice(
    everything: "pd.DataFrame",
    factors: Factors,
    people: Mapping[str, str],
    tests: "pd.DataFrame",
    primary: Sequence[str],
) -> Iterator[Shortfall]:
    if not factors.practice:
        return
    done = practised(everything)
    levels = {"practice": ("counted", "practice"), GROUP: factors.groups}
    for measure in measures_in(done, primary):
        recorded = everything.assign(practice=practice_words(everything))
        design = _Design(done, recorded, measure, ("practice",), levels, people, {})
        tested = "practice" in _made(tests, measure)
        yield from design.lacking(("practice",), "practice", tested=tested)


def _of_scores(
    scores: "pd.DataFrame", tests: "pd.DataFrame", people: dict[str, str]
) -> Iterator[Shortfall]:
    groups = tuple(sorted({name for name in people.values() if name}))
    for outcome, own in occasions(scores, people).groupby("outcome"):
        levels = {"occasion": tuple(sorted(own["occasion"].unique())), GROUP: groups}
        levels = {name: each for name, each in levels.items() if len(each) > 1}
        made = _made(tests, str(outcome))
        table = own.rename(columns={"value": str(outcome)})
        design = _Design(table, table, str(outcome), ("occasion",), levels, people, {})
        for name in levels:
            yield from design.lacking((name,), name, tested=name in made)
        behind = after_conditions(table)
        conditions = tuple(sorted(behind[CONDITION].unique()))
        each = behind.groupby("participant")[CONDITION].nunique()
        if len(conditions) > 1 and each.max() > 1:  # else it was asked after one of them
            own_levels = {CONDITION: conditions}
            design = _Design(behind, behind, str(outcome), (CONDITION,), own_levels, people, {})
            yield from design.lacking((CONDITION,), CONDITION, tested=CONDITION in made)


def _made(tests: "pd.DataFrame", measure: str) -> set[str]:
    return set(tests.loc[tests["measure"] == measure, "factor"]) if len(tests) else set()


def _of_plan(
    plan: Plan,
    everything: "pd.DataFrame",
    measure: str,
    factors: Factors,
    people: Mapping[str, str],
    made: set[str],
) -> Iterator[Shortfall]:
    results = everything[is_result(everything)]
    names = {*plan.within, GROUP}
    levels = {name: factors.levels(name) for name in names}
    if plan.phase:
        levels[PLACE] = levels[PLACE][: factors.places[plan.phase]]
    levels = {name: own for name, own in levels.items() if len(own) > 1}
    words = {name: named_factor(name, factors) for name in names}
    recorded = plan.of(_counted(everything))
    design = _Design(plan.of(results), recorded, measure, plan.within, levels, people, words)
    effects = [plan.asked] if plan.asked else [(name,) for name in (*plan.within, GROUP)]
    for effect in effects:
        if not set(effect) <= set(levels):
            continue  # it was not planned to vary
        plain = ":".join(effect) + plan.suffix
        name, before = (named_factor(each, factors) for each in (plain, _before(plain)))
        if not plan.beside or name in made:
            yield from design.lacking(effect, name, tested=name in made)
        elif before in made:
            apart = plan.confounded(results, measure, design.whole)
            few = "there are too few people to estimate their variance"
            why = f"positions cannot be distinguished from {apart}" if apart else few
            yield Shortfall(measure, name, "", len(people), len(design.whole), why)


def _before(name: str) -> str:
    return name.removesuffix(ADJUSTED)


class _Design:
    """Cells of a planned test: who has all of them, and the missing ones."""

    def __init__(
        self,
        table: "pd.DataFrame",
        recorded: "pd.DataFrame",
        measure: str,
        within: tuple[str, ...],
        levels: Mapping[str, tuple[Any, ...]],
        people: Mapping[str, str],
        words: Mapping[str, str],
    ) -> None:
        self.measure, self.levels, self.people = measure, levels, people
        self._known = table.dropna(subset=[measure])
        self._done, self._recorded = table, recorded
        self._unseen = recorded[is_success(recorded) & not_presented(recorded)]
        self.whole, self._empty = whole_people(table, measure, within)
        grouped = {who: people.get(who, "") for who in self.whole} if GROUP in levels else {}
        self._alone = alone(grouped)
        self._there = {
            name: [level for level in levels[name] if (self._known[name] == level).any()]
            for name in within
            if name in levels
        }
        self._words = words
        varied = [self._word(name) for name in within if len(self._there.get(name, ())) > 1]
        self._cells = f" in every cell of {' and '.join(varied)}" if varied else ""

    def lacking(self, effect: tuple[str, ...], name: str, *, tested: bool) -> Iterator[Shortfall]:
        """Yield the shortfalls of the test of one effect."""
        if not tested:
            why = self._why(effect)
            yield Shortfall(self.measure, name, "", len(self.people), len(self.whole), why)
            return
        for factor in effect:
            for level in self._gone(factor):
                without, why = (
                    f"{self._word(factor)} {word(level)}",
                    "no participant has a value there",
                )
                yield Shortfall(self.measure, name, without, len(self.people), 0, why)
        for group in self.levels.get(GROUP, ()):
            members = [who for who, own in self.people.items() if own == group]
            if members and not set(members) & set(self.whole):
                why = f"none of its {len(members)} people has a value in every cell"
                yield Shortfall(self.measure, name, f"{GROUP} {group}", len(members), 0, why)

        yield from self.missing(name)

    def missing(self, name: str) -> Iterator[Shortfall]:
        """Yield who is not in the test, and their missing cells."""
        varied = {factor: own for factor, own in self._there.items() if len(own) > 1}
        cells = set(product(*varied.values()))
        why: dict[str, list[str]] = {}
        for who, group in self.people.items():
            if who in self._alone:
                said = f"alone in group {group}" if group else "in no group"
                why.setdefault(said, []).append(who)
            elif who not in self.whole:
                lacks = cells - _cells_of(self._known, who, list(varied))
                recorded = _cells_of(self._recorded, who, list(varied))
                done = _cells_of(self._done, who, list(varied))
                unseen = _cells_of(self._unseen, who, list(varied)) - done
                of_kind = {
                    NOTHING: lacks - recorded,
                    "no success": (lacks & recorded) - done - unseen,
                    "no success that was shown": lacks & unseen,
                    "no value": lacks & done,
                }
                kinds = [
                    kind + self._where(own, cells, list(varied))
                    for kind, own in of_kind.items()
                    if own
                ]
                why.setdefault(" and ".join(kinds), []).append(who)
        yield from left_out(self.measure, name, why, len(self.people))

    def _where(
        self, lacks: set[tuple[Any, ...]], cells: set[tuple[Any, ...]], names: list[str]
    ) -> str:
        """Return a description of cells: all with some levels of one factor, or one by one."""
        if lacks == cells:
            return ""
        for at, name in enumerate(names):
            levels = {cell[at] for cell in lacks}
            if lacks == {cell for cell in cells if cell[at] in levels}:
                return f" at {self._word(name)} {', '.join(map(word, sorted(levels)))}"
        said = [
            ", ".join(
                f"{self._word(name)} {word(level)}" for name, level in zip(names, cell, strict=True)
            )
            for cell in sorted(lacks)
        ]
        more = f" and {len(said) - SHOWN} more" if len(said) > SHOWN else ""
        return f" at {'; '.join(said[:SHOWN])}{more}"

    def _word(self, name: str) -> str:
        return self._words.get(name, name)

    def _gone(self, factor: str) -> list[Any]:
        there = self._there.get(factor)
        return [] if there is None else [one for one in self.levels[factor] if one not in there]

    def _why(self, effect: tuple[str, ...]) -> str:
        kept = [who for who in self.whole if who not in self._alone]
        whole, groups = len(kept), {self.people.get(who, "") for who in kept}
        for factor in effect:
            if len(self._there.get(factor, "ab")) < 2:  # noqa: PLR2004 - two can be compared
                gone = ", ".join(map(word, self._gone(factor)))
                return f"no participant has a value at {self._word(factor)} {gone}"
        if whole < LEAST:
            have = f"{len(self.whole)} of {len(self.people)} people have a value{self._cells}"
            if len(self.whole) >= LEAST:
                have += f", {len(self._alone)} of them alone in a group or in none"
            return f"{have}, and {LEAST} are needed{self._nobody()}"
        if len(groups) < 2 and GROUP in effect:  # noqa: PLR2004
            return f"all {whole} people with a value{self._cells} are in group {groups.pop()}"
        return f"the {whole} people with a value{self._cells} do not differ in the tested values"

    def _nobody(self) -> str:
        said = [", ".join(map(word, cell)) for cell in self._empty]
        if not said:
            return ""
        more = f" and {len(said) - SHOWN} more" if len(said) > SHOWN else ""
        return f"; no participant has one at {'; '.join(said[:SHOWN])}{more}"


def left_out(
    measure: str, name: str, why: Mapping[str, list[str]], people: int
) -> Iterator[Shortfall]:
    """Yield who is not in a test, from people by their reason; empty if all are in it."""
    gone = [who for own in why.values() for who in own]
    if not gone:
        return
    if len(why) == 1:
        (said,) = why
    else:
        said = "; ".join(f"{people_in_words(own)}: {reason}" for reason, own in why.items())
    yield Shortfall(measure, name, people_in_words(gone), people, people - len(gone), said)


def people_in_words(names: Sequence[str]) -> str:
    """Return names in words: ``P001, P002 and P003``."""
    if len(names) > NAMED:
        return f"{', '.join(names[:NAMED])} and {len(names) - NAMED} more"
    *others, last = sorted(names)
    return f"{', '.join(others)} and {last}" if others else last


def _cells_of(table: "pd.DataFrame", who: str, names: list[str]) -> set[tuple[Any, ...]]:
    """Return the cells in which a participant has rows; the only one if there are no factors."""
    own = table[table["participant"] == who]
    if not names:
        return {()} if len(own) else set()
    return set(own[names].drop_duplicates().itertuples(index=False, name=None))


def _counted(everything: "pd.DataFrame") -> "pd.DataFrame":
    return everything[everything["practice"].astype(float) == 0.0]


def _of_trends(
    everything: "pd.DataFrame",
    measure: str,
    factors: Factors,
    people: Mapping[str, str],
    trends: "pd.DataFrame",
) -> Iterator[Shortfall]:
    results, recorded = everything[is_result(everything)], _counted(everything)
    made = trends[trends["measure"] == measure] if len(trends) else trends
    for phase in factors.phases:
        if factors.places[phase] < 2:  # noqa: PLR2004
            continue
        name = f"linear trend of {SEQUENCE} in {phase}"
        known = results[results[PHASE] == phase].dropna(subset=[measure])
        places = known.groupby("participant")[PLACE].nunique()
        several = set(map(str, places[places > 1].index))
        if len(made) and (made[factors.kind] == phase).any():
            there = set(recorded.loc[recorded[PHASE] == phase, "participant"])
            reasons: dict[str, list[str]] = {}
            for who in people:
                if who not in several:
                    few = "values at fewer than two positions"
                    few = few if who in there else f"{NOTHING} in {phase}"
                    reasons.setdefault(few, []).append(who)
            yield from left_out(measure, name, reasons, len(people))
            continue
        why = f"{len(several)} of {len(people)} people have values at two or more positions"
        why += (
            f", and {LEAST} are needed" if len(several) < LEAST else ", whose slopes do not differ"
        )
        yield Shortfall(measure, name, "", len(people), len(several), why)


def _of_scales(
    everything: "pd.DataFrame", measure: str, factors: Factors, scales: "pd.DataFrame"
) -> Iterator[Shortfall]:
    """Yield who lacks a quantity of the time scales; others have a row of their own."""
    recorded = _counted(everything)
    for row in scales[scales["measure"] == measure].to_dict("records") if len(scales) else ():
        if row["why"] or row["group"] != "all":
            continue
        phase = str(row["phase"])
        of = [phase]
        if row["quantity"] not in {"slope", "gain"}:
            of.insert(0, factors.phases[factors.phases.index(phase) - 1])
        reasons: dict[str, list[str]] = {}
        for who in str(row["left_out"]).split():
            mine = recorded[recorded["participant"] == who]
            away = [each for each in of if not (mine[PHASE] == each).any()]
            few = {"slope": "values at fewer than two positions", "change": "no value in a phase"}
            why = few.get(row["quantity"], "no value at a first or last position")
            why = f"{NOTHING} in {' and '.join(away)}" if away else why
            reasons.setdefault(why, []).append(who)
        yield from left_out(measure, f"{row['quantity']} of {phase}", reasons, len(factors.people))
