"""Shortfalls of planned tests: what could not be tested, or not of everybody, and why."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from labcrane.analysis.quality import is_result
from labcrane.analysis.report.factors import DISTANCE, GROUP, PHASE, PLACE, Factors
from labcrane.analysis.report.outcomes import (
    ADJUSTED,
    SEQUENCE,
    Plan,
    measures_in,
    named_factor,
    occasions,
    of_gaze,
    plans,
    practised,
)
from labcrane.analysis.statistics.anova import LEAST, whole_people, word

if TYPE_CHECKING:
    import pandas as pd

SHOWN = 3
"""Cells without a value that are named; of more their number is told."""


@dataclass(frozen=True, slots=True)
class Shortfall:
    """What a planned test lacks.

    Attributes
    ----------
    measure, factor
        What was to be tested, over what, as the tables of tests name it.
    without
        The group or level that the test had to do without; empty where there is no test.
    people
        Of the sample, or of the group it had to do without.
    whole
        Those of them with a value in every cell.
    why
        The same in words.
    """

    measure: str
    factor: str
    without: str
    people: int
    whole: int
    why: str


@dataclass(frozen=True, slots=True)
class Made:
    """Tests that were made, as the report's tables have them.

    Attributes
    ----------
    anova, trends, practice, gaze, scores
        Empty ones where none was.
    """

    anova: "pd.DataFrame"
    trends: "pd.DataFrame"
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
    """Return what planned tests lack; empty where all were made, of every group and level.

    Parameters
    ----------
    everything
        All movements, with factors.
    scores
        Of questionnaires.
    made
        The tests that were made.
    factors
        What varies, and who is in the sample.
    """
    import pandas as pd

    people, results = factors.people, everything[is_result(everything)]
    found: list[Shortfall] = []
    for measure in measures_in(results, primary):
        tested = _made(made.anova, measure)
        for plan in plans(results, factors):
            found += _of_plan(plan, results, measure, factors, people, tested)
        found += _of_trends(results, measure, factors, people, made.trends)
    found += _of_practice(everything, factors, people, made.practice, primary)
    for name in of_gaze(results):
        plan = Plan((*factors.over_phases, DISTANCE))
        found += _of_plan(plan, results, name, factors, people, _made(made.gaze, name))
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
        design = _Design(done, measure, ("practice",), levels, people, {})
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
        design = _Design(table, str(outcome), ("occasion",), levels, people, {})
        for name in levels:
            yield from design.lacking((name,), name, tested=name in made)


def _made(tests: "pd.DataFrame", measure: str) -> set[str]:
    return set(tests.loc[tests["measure"] == measure, "factor"]) if len(tests) else set()


def _of_plan(
    plan: Plan,
    results: "pd.DataFrame",
    measure: str,
    factors: Factors,
    people: Mapping[str, str],
    made: set[str],
) -> Iterator[Shortfall]:
    names = {*plan.within, GROUP}
    levels = {name: factors.levels(name) for name in names}
    if plan.phase:
        levels[PLACE] = levels[PLACE][: factors.places[plan.phase]]
    levels = {name: own for name, own in levels.items() if len(own) > 1}
    words = {name: named_factor(name, factors) for name in names}
    design = _Design(plan.of(results), measure, plan.within, levels, people, words)
    effects = [plan.asked] if plan.asked else [(name,) for name in (*plan.within, GROUP)]
    for effect in effects:
        if not set(effect) <= set(levels):
            continue  # it was not to vary
        plain = ":".join(effect) + plan.suffix
        name, before = (named_factor(each, factors) for each in (plain, _before(plain)))
        if not plan.beside:
            yield from design.lacking(effect, name, tested=name in made)
        elif name not in made and before in made:
            apart = plan.confounded(results, measure)
            few = "so few people leave nothing to tell how they differ"
            why = f"positions cannot be told from {apart}" if apart else few
            yield Shortfall(measure, name, "", len(people), len(design.whole), why)


def _before(name: str) -> str:
    return name.removesuffix(ADJUSTED)


class _Design:
    """Cells of a planned test: who has all of them, and what is missing."""

    def __init__(
        self,
        table: "pd.DataFrame",
        measure: str,
        within: tuple[str, ...],
        levels: Mapping[str, tuple[Any, ...]],
        people: Mapping[str, str],
        words: Mapping[str, str],
    ) -> None:
        self.measure, self.levels, self.people = measure, levels, people
        self.whole, self._empty = whole_people(table, measure, within)
        known = table.dropna(subset=[measure])
        self._there = {
            name: [level for level in own if (known[name] == level).any()]
            for name, own in levels.items()
            if name in within
        }
        self._words = words
        varied = [self._word(name) for name in within if len(self._there.get(name, ())) > 1]
        self._cells = f" in every cell of {' and '.join(varied)}" if varied else ""

    def lacking(self, effect: tuple[str, ...], name: str, *, tested: bool) -> Iterator[Shortfall]:
        """Yield what the test of one effect lacks."""
        if not tested:
            why = self._why(effect)
            yield Shortfall(self.measure, name, "", len(self.people), len(self.whole), why)
            return
        for factor in effect:
            for level in self._gone(factor):
                without, why = f"{self._word(factor)} {word(level)}", "nobody has a value there"
                yield Shortfall(self.measure, name, without, len(self.people), 0, why)
        for group in self.levels.get(GROUP, ()):
            members = [who for who, own in self.people.items() if own == group]
            if members and not set(members) & set(self.whole):
                why = f"none of its {len(members)} people has a value in every cell"
                yield Shortfall(self.measure, name, f"{GROUP} {group}", len(members), 0, why)

    def _word(self, name: str) -> str:
        return self._words.get(name, name)

    def _gone(self, factor: str) -> list[Any]:
        there = self._there.get(factor)
        return [] if there is None else [one for one in self.levels[factor] if one not in there]

    def _why(self, effect: tuple[str, ...]) -> str:
        whole, groups = len(self.whole), {self.people.get(who, "") for who in self.whole}
        for factor in effect:
            if len(self._there.get(factor, "ab")) < 2:  # noqa: PLR2004 - two can be compared
                gone = ", ".join(map(word, self._gone(factor)))
                return f"nobody has a value at {self._word(factor)} {gone}"
        if whole < LEAST:
            have = f"{whole} of {len(self.people)} people have a value{self._cells}"
            return f"{have}, and {LEAST} are needed{self._nobody()}"
        if len(groups) < 2 and GROUP in effect:  # noqa: PLR2004
            return f"all {whole} people with a value{self._cells} are in group {groups.pop()}"
        if GROUP in self.levels and whole <= len(groups):
            return (
                f"{whole} people with a value{self._cells} are in {len(groups)} groups, "
                "which leaves nothing to tell how people differ"
            )
        return f"the {whole} people with a value{self._cells} do not differ in what is tested"

    def _nobody(self) -> str:
        said = [", ".join(map(word, cell)) for cell in self._empty]
        if not said:
            return ""
        more = f" and {len(said) - SHOWN} more" if len(said) > SHOWN else ""
        return f"; nobody has one at {'; '.join(said[:SHOWN])}{more}"


def _of_trends(
    results: "pd.DataFrame",
    measure: str,
    factors: Factors,
    people: Mapping[str, str],
    trends: "pd.DataFrame",
) -> Iterator[Shortfall]:
    made = trends[trends["measure"] == measure] if len(trends) else trends
    for phase in factors.phases:
        if factors.places[phase] < 2 or (len(made) and (made[factors.kind] == phase).any()):  # noqa: PLR2004
            continue
        known = results[results[PHASE] == phase].dropna(subset=[measure])
        several = int((known.groupby("participant")[PLACE].nunique() > 1).sum())
        why = f"{several} of {len(people)} people have values at two or more positions"
        why += f", and {LEAST} are needed" if several < LEAST else ", whose slopes do not differ"
        name = f"linear trend of {SEQUENCE} in {phase}"
        yield Shortfall(measure, name, "", len(people), several, why)
