"""Power of the report's own tests: cohorts of participants, each tested as the report does."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from labcrane.analysis.parallel import work
from labcrane.analysis.quality import is_result
from labcrane.analysis.report import outcomes
from labcrane.analysis.report.factors import (
    BLOCK,
    CONDITION,
    DISTANCE,
    GROUP,
    PHASE,
    PLACE,
    SEQUENCE,
    SESSION,
    Factors,
    factors_of,
    with_factors,
)
from labcrane.analysis.statistics.anova import compare, word
from labcrane.analysis.statistics.mixed import NoModelError, mixed_model
from labcrane.analysis.statistics.trends import linear_trend
from labcrane.errors import ProtocolError
from labcrane.simulation.power import (
    DIFFERENCE,
    Claim,
    Effect,
    Outcomes,
    Power,
    Tested,
    pair_of,
    people_of,
    summarise,
)
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

Kind = Literal["anova", "contrast", "trend", "mixed"]

NAMES: Mapping[Kind, str] = {
    "anova": "analysis of variance", "contrast": "contrast, corrected after Holm",
    "trend": "linear trend", "mixed": "mixed model",
}  # fmt: skip
"""Names of the tests."""

_OF_GROUP = re.compile(rf"{GROUP}\[T\.[^\]]+\]")

CHUNK = 25
"""Cohorts that a worker is given at a time."""


@dataclass(frozen=True)
class PlannedTest:
    """A planned test of the report, and the movements of the participants who are drawn.

    Attributes
    ----------
    kind
        ``anova``: the F test of an effect, corrected after Greenhouse and Geisser. ``contrast``: a
        difference of two levels, corrected after Holm. ``trend``: participants' slopes over the
        sequence. ``mixed``: a term of the mixed model.
    effect
        Its factor is an effect as the report's table names it: ``group:sequence``.
    results
        Movements that are results, with the report's factors.
    factors
        Factors of the study.
    people
        All participants who may be sampled, and their group, including dropouts without a result.
    """

    kind: Kind
    effect: Effect
    results: "pd.DataFrame"
    factors: Factors
    people: Mapping[str, str]

    @property
    def levels(self) -> list[Any]:
        """The levels of its factor in these movements."""
        asked = column(self.effect.factor, self.factors)
        if asked == CONDITION:  # some blocks are of none
            return list(self.factors.conditions)
        return sorted(self.results[asked].unique())

    @cached_property
    def pair(self) -> tuple[str, str]:
        """The two levels of a contrast, as the report names them: the second less the first."""
        one, other = map(word, pair_of(self.effect, self.levels))
        return one, other

    @property
    def of_groups(self) -> bool:
        """Whether the effect is between participants alone; a mixed model names it by a level."""
        own = self.effect.factor == GROUP or _OF_GROUP.fullmatch(self.effect.factor) is not None
        return own and bool(self.factors.groups)


@dataclass(frozen=True, slots=True)
class ReportedTest:
    """Result of a test of one cohort.

    Attributes
    ----------
    p
        As the report corrects it; NaN where there was no test.
    estimate, error, freedom
        The effect, its standard error and degrees of freedom; NaN of an F test.
    """

    p: float
    estimate: float = np.nan
    error: float = np.nan
    freedom: float = np.nan

    def moved(self, by: float) -> "ReportedTest":
        """Return the answer, uncorrected, where the effect is larger by so much.

        The estimate is linear in it, and its error is of how people differ: it stays.
        """
        from scipy.stats import t

        estimate = self.estimate + by
        p = float(2.0 * t.sf(abs(estimate) / self.error, self.freedom))
        return ReportedTest(p, estimate, self.error, self.freedom)


NOTHING = ReportedTest(np.nan)


def plan_test(
    kind: Kind,
    effect: Effect,
    movements: "pd.DataFrame",
    claim: Claim,
    people: Mapping[str, str] | None = None,
) -> PlannedTest:
    """Return a planned test, tried once on the whole pool.

    Parameters
    ----------
    movements
        Movements of all participants, including those that are not results.
    people
        All participants who began, and their group, including those without any movement; by
        default, the participants with movements.

    Raises
    ------
    ProtocolError
        The report has no such test, or nothing of the kind can be claimed of it.
    """
    if effect.log:
        raise ProtocolError(
            f"log({effect.measure}): the report tests measures as they are, and its mixed model "
            "takes logarithms of times by itself; write the measure alone"
        )
    if kind == "anova" and (claim.kind != "difference" or effect.size is not None):
        raise ProtocolError(
            "an F test has no direction: no equivalence or non-inferiority is shown by it, and no "
            "size put in; take --test contrast, trend or mixed"
        )
    if effect.measure not in movements:
        raise ProtocolError(
            f"movements have no {effect.measure!r}; they have {', '.join(map(str, movements))}"
        )
    table = with_factors(movements)
    factors = factors_of(table)
    results = table[is_result(table)]
    wanted = ["participant", "pair", "distance", "difficulty", "far_side", SEQUENCE, GROUP, PHASE]
    wanted += [SESSION, BLOCK, PLACE, CONDITION]
    kept = [name for name in (*wanted, effect.measure) if name in results]
    everybody = dict(people or people_of(movements))
    planned = PlannedTest(kind, effect, results[kept].reset_index(drop=True), factors, everybody)
    _check(planned)
    if np.isnan(ask(planned, planned.results).p):
        raise ProtocolError(
            f"cannot test {effect.measure} by {effect.factor} on the whole pool: three or more "
            "participants need a value at every level, and the values must vary"
        )
    return planned


def _check(planned: PlannedTest) -> None:
    kind, effect = planned.kind, planned.effect
    if kind == "contrast" and not effect.between:
        raise ProtocolError(
            f"a contrast is of two levels; write {effect.measure}~{effect.factor}[ONE,OTHER]"
        )
    if kind != "contrast" and effect.between:
        raise ProtocolError(
            f"--test {kind} tests all levels, and [{','.join(effect.between)}] are two; write "
            f"{effect.measure}~{effect.factor}, or --test contrast to compare the two"
        )
    if kind == "trend" and (effect.factor != SEQUENCE or len(planned.factors.phases) > 1):
        raise ProtocolError(
            "the report's trend is over the sequence of one session or block; write "
            f"{effect.measure}~sequence, or take --test anova or mixed for several"
        )
    there = names(planned)
    if effect.factor not in there:
        raise ProtocolError(
            f"the report has no {kind} test of {effect.measure} over {effect.factor!r}; it has "
            f"{', '.join(there) or 'none here'}"
        )
    if kind == "contrast":
        pair_of(effect, planned.levels)


def names(planned: PlannedTest) -> list[str]:
    """Return the effects of which the report has such a test, for this measure."""
    factors, results, measure = planned.factors, planned.results, planned.effect.measure
    match planned.kind:
        case "anova":
            return [test.factor for test in outcomes.tests(results, measure, factors)]
        case "contrast":
            there = [*factors.between, *factors.over_phases, DISTANCE]
            there += [CONDITION] * bool(factors.conditions)
            return [factors.named(each) for each in there if each in results]
        case "trend":
            return [SEQUENCE]
    try:
        model = mixed_model(results.assign(sequence=results[PLACE]), measure)
    except NoModelError:
        return []
    return [str(each) for each in model.terms["term"][1:]]


def column(factor: str, factors: Factors) -> str:
    """Return the column of a factor that the report calls ``factor``."""
    named = {factors.named(name): name for name in factors.over_phases}
    return named.get(factor, factor)


def ask(planned: PlannedTest, results: "pd.DataFrame") -> ReportedTest:
    """Return the result of the report's test for some participants' movements."""
    return NOTHING if results.empty else ASKED[planned.kind](planned, results)


def _anova(planned: PlannedTest, results: "pd.DataFrame") -> ReportedTest:
    for test in outcomes.tests(results, planned.effect.measure, planned.factors):
        if test.factor == planned.effect.factor:
            return ReportedTest(test.p_gg)
    return NOTHING


def _contrast(planned: PlannedTest, results: "pd.DataFrame") -> ReportedTest:
    effect, factors = planned.effect, planned.factors
    one, other = planned.pair
    within = [*factors.over_phases, *[name for name in (effect.factor,) if name == DISTANCE]]
    asked, period = column(effect.factor, factors), ""
    if asked == CONDITION:
        plan = outcomes.CONDITIONS
        results, within, period = plan.of(results), [CONDITION], plan.period
    for row in compare(results, effect.measure, asked, within, factors.between, period=period):
        if {row.first, row.second} == {one, other}:
            # Other minus one, as the effect is written; the report's is first minus second.
            sign = -1.0 if row.second == other else 1.0
            return ReportedTest(row.p_holm, sign * row.difference, row.se, row.df)
    return NOTHING


def _trend(planned: PlannedTest, results: "pd.DataFrame") -> ReportedTest:
    trend = linear_trend(results.assign(sequence=results[PLACE]), planned.effect.measure)
    if trend is None:
        return NOTHING
    return ReportedTest(trend.p, trend.slope, trend.slope / trend.t, trend.df)


def _mixed(planned: PlannedTest, results: "pd.DataFrame") -> ReportedTest:
    try:
        model = mixed_model(results.assign(sequence=results[PLACE]), planned.effect.measure)
    except NoModelError:
        return NOTHING
    own = model.terms[model.terms["term"] == planned.effect.factor]
    if own.empty:
        return NOTHING
    p, estimate, error, freedom = own[["p", "estimate", "se", "df"]].to_numpy(float)[0].tolist()
    return ReportedTest(p, estimate, error, freedom)


ASKED: Mapping[Kind, Callable[[PlannedTest, "pd.DataFrame"], ReportedTest]] = {
    "anova": _anova, "contrast": _contrast, "trend": _trend, "mixed": _mixed,
}  # fmt: skip
"""Functions of each kind of test."""


class Drawer:
    """Draws cohorts of participants with replacement, from each group as many."""

    def __init__(self, planned: PlannedTest) -> None:
        self._planned = planned
        rows = planned.results.groupby("participant").indices
        self._rows = [rows.get(name, np.empty(0, np.intp)) for name in planned.people]
        groups = planned.factors.groups
        self._members = [
            [at for at, own in enumerate(planned.people.values()) if own == each or not groups]
            for each in groups or ("",)
        ]

    def draw(self, size: int, random: np.random.Generator) -> npt.NDArray[np.intp]:
        """Return the numbers of who is in a cohort, shape ``(size,)``."""
        groups = len(self._members)
        return np.concatenate(
            [
                np.array(members)[random.integers(len(members), size=(size + number) // groups)]
                for number, members in enumerate(self._members)
            ]
        )

    def cohort(self, drawn: npt.NDArray[np.intp]) -> "pd.DataFrame":
        """Return a cohort's movements; a participant who is sampled twice is two people."""
        rows = [self._rows[at] for at in drawn.tolist()]
        cohort = self._planned.results.take(np.concatenate(rows)).reset_index(drop=True)
        numbers = np.repeat(np.arange(len(rows)), [len(own) for own in rows])
        return cohort.assign(participant=numbers)

    def permuted(self, cohort: "pd.DataFrame", random: np.random.Generator) -> "pd.DataFrame":
        """Return a cohort in which the effect is nothing.

        Groups are permuted over participants; of any other effect the measure within each of them.
        """
        if self._planned.of_groups:
            labels = cohort.groupby("participant")[GROUP].first()
            mixed = dict(zip(labels.index, random.permutation(labels.to_numpy()), strict=True))
            return cohort.assign(**{GROUP: cohort["participant"].map(mixed)})
        measure = self._planned.effect.measure
        values = cohort[measure].to_numpy(float).copy()
        ends = np.flatnonzero(np.diff(cohort["participant"])) + 1
        for own in np.split(values, ends):
            random.shuffle(own)  # a view
        return cohort.assign(**{measure: values})


def power_of_report(
    planned: PlannedTest,
    sizes: Sequence[int],
    cohorts: int,
    seed: int,
    claim: Claim = DIFFERENCE,
    workers: int | None = 1,
    scheduler: str | None = None,
) -> Iterator[Power]:
    """Yield the power of the test for each size of the cohort.

    A cohort depends only on the seed, its size and its number, in whichever process it is sampled.
    """
    there, wanted = ask(planned, planned.results).estimate, planned.effect.size
    true = there if wanted is None else wanted
    by = None if wanted is None else wanted - there
    for size in sizes:
        chunks = [
            (size, seed, first, min(first + CHUNK, cohorts)) for first in range(0, cohorts, CHUNK)
        ]
        made = dict(work(partial(_chunk, planned, by), chunks, workers, scheduler))
        tried = [each for first in sorted(made) for each in made[first]]
        found, null = [one.found for one in tried], [one.null for one in tried]
        if claim.margin:
            null = [each.moved(claim.margin - true) for each in found]
        yield summarise(
            size,
            Outcomes(_p(found, claim), np.array([each.estimate for each in found])),
            Outcomes(_p(null, claim)),
            true if claim.kind == "difference" else 0.0,
            np.stack([one.drawn for one in tried]),
            len(planned.people),
        )


@dataclass(frozen=True, slots=True)
class Tried:
    """A cohort that was tested: its participants, and the results with the effect and without."""

    drawn: npt.NDArray[np.intp]
    found: ReportedTest
    null: ReportedTest


def _chunk(
    planned: PlannedTest, by: float | None, order: tuple[int, int, int, int]
) -> tuple[int, list[Tried]]:
    """Test some cohorts, with the effect moved and with nothing to find; a worker's function."""
    size, seed, first, last = order
    drawer = Drawer(planned)
    tried = []
    for number in range(first, last):
        random = np.random.default_rng([seed, size, number])
        drawn = drawer.draw(size, random)
        cohort = drawer.cohort(drawn)
        null = ask(planned, drawer.permuted(cohort, random))
        tried.append(Tried(drawn, _found(planned, cohort, by), null))
    return first, tried


def _found(planned: PlannedTest, cohort: "pd.DataFrame", by: float | None) -> ReportedTest:
    """Return the result of the test for a cohort in which the effect is larger by so much.

    A contrast is corrected together with all others of its factor, which contain the second level:
    the movements of that level are shifted. For the other tests, the result itself is shifted.
    """
    if by is None:
        return ask(planned, cohort)
    if planned.kind != "contrast":
        return ask(planned, cohort).moved(by)
    effect = planned.effect
    own = cohort[column(effect.factor, planned.factors)].map(word) == planned.pair[1]
    return ask(planned, cohort.assign(**{effect.measure: cohort[effect.measure] + by * own}))


def _p(answers: Sequence[ReportedTest], claim: Claim) -> FloatArray:
    if claim.kind == "difference":
        return np.array([each.p for each in answers])
    columns = ("estimate", "error", "freedom")
    return claim.p(
        Tested(*(np.array([getattr(each, name) for each in answers]) for name in columns))
    )
