"""Power of a planned test: cohorts drawn from a pool of simulated participants."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from labcrane.analysis.quality import is_result
from labcrane.analysis.report.factors import GROUP
from labcrane.analysis.statistics.anova import word
from labcrane.errors import ProtocolError
from labcrane.simulation.share import share_of
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

ALPHA = 0.05
ROUNDING = 1e-12
"""Standard error, as a share of the largest number, that is rounding and not a spread of people."""
_TERM = r"[a-z0-9_]+(?:\[T\.[^\]]+\])?"  # the second as a mixed model names the level of a factor
_EFFECT = re.compile(
    rf"(log\()?([a-z0-9_]+)(\))?~({_TERM}(?::{_TERM})*)(?:\[(.+),(.+)\])?(?:=(.+))?"
)
_BLANKS = re.compile(r"\s*([~=,:()\[\]])\s*")


@dataclass(frozen=True, slots=True)
class Effect:
    """Subject of a planned test: ``movement_time~sequence``, ``error~group[none,visual]=0.2``.

    Attributes
    ----------
    measure, log
        A column of the movements, and whether its logarithm is tested.
    factor
        The column it depends on. A number is tested for a linear trend over its levels, words for
        a difference between them; both by participants' means.
    between
        The two levels that are compared, as they are written: the effect is the second less the
        first. Empty for all there are, words then by the alphabet.
    size
        The effect that is put in place of the one that there is, in the measure's unit per step of
        a number or between two words; None takes the data as they were simulated.
    """

    measure: str
    log: bool
    factor: str
    between: tuple[str, ...]
    size: float | None


def read_effect(text: str) -> Effect:
    """Read an effect from the command line."""
    found = _EFFECT.fullmatch(_BLANKS.sub(r"\1", text.strip()))
    try:
        size = float(found[7]) if found and found[7] else None
    except ValueError:
        found, size = None, None
    if found is None or bool(found[1]) != bool(found[3]):
        raise ProtocolError(
            f"{text!r} is not an effect; write MEASURE~FACTOR, log(MEASURE)~FACTOR, "
            "MEASURE~FACTOR[WORD,WORD] or MEASURE~FACTOR=SIZE, as in movement_time~sequence=-0.1"
        )
    between = (found[5], found[6]) if found[5] else ()
    return Effect(found[2], bool(found[1]), found[4], between, size)


@dataclass(frozen=True, slots=True)
class Claim:
    """Claim that a planned test is to show.

    Attributes
    ----------
    kind
        ``difference``: p below :data:`ALPHA`. ``equivalence``: both one-sided tests against the
        margin (Schuirmann 1987). ``non_inferiority``: the one against the margin.
    margin
        In the unit of the effect, above 0 for equivalence. For non-inferiority it is how much the
        effect may be above 0 at most or, below 0, how much below.
    """

    kind: Literal["difference", "equivalence", "non_inferiority"] = "difference"
    margin: float = 0.0

    def __post_init__(self) -> None:
        if self.kind == "difference" and self.margin:
            raise ProtocolError(
                f"a margin of {self.margin:g} is for equivalence or non-inferiority; name one with "
                "--claim, or leave out --margin"
            )
        if (self.kind == "equivalence" and self.margin <= 0.0) or (
            self.kind == "non_inferiority" and self.margin == 0.0
        ):
            raise ProtocolError(
                f"{self.kind} is shown against a margin, and {self.margin:g} is not one; give "
                "--margin in the unit of the effect"
            )

    def p(self, tested: "Tested") -> FloatArray:
        """Return each cohort's p, shape ``(cohorts,)``: below :data:`ALPHA` it is shown.

        NaN where there was no test. Of two one-sided tests the larger p counts.
        """
        from scipy.stats import t

        with np.errstate(invalid="ignore", divide="ignore"):
            below = t.cdf((tested.estimate - self.margin) / tested.error, tested.freedom)
            above = t.sf((tested.estimate + abs(self.margin)) / tested.error, tested.freedom)
            match self.kind:
                case "difference":
                    size = np.abs(tested.estimate) / tested.error
                    return np.asarray(2.0 * t.sf(size, tested.freedom))
                case "equivalence":
                    return np.asarray(np.maximum(below, above))
            return np.asarray(below if self.margin > 0.0 else above)


DIFFERENCE = Claim()


@dataclass(frozen=True, slots=True)
class Tested:
    """Estimates of a test for each cohort, in the unit of the effect; shapes ``(cohorts,)``.

    Attributes
    ----------
    estimate, error
        The effect and its standard error.
    freedom
        Degrees of freedom of the t test; Welch's between groups.
    """

    estimate: FloatArray
    error: FloatArray
    freedom: FloatArray

    def moved(self, by: float) -> "Tested":
        """Return the same of people whose effects are all larger by so much.

        An estimate is linear in them, and its error is of how people differ: it stays.
        """
        return replace(self, estimate=self.estimate + by)


@dataclass(frozen=True, slots=True)
class Pool:
    """Data that a test needs from every participant.

    Attributes
    ----------
    means
        Participants' means at each level, shape ``(n_participants, n_levels)``; with groups,
        shape ``(n_participants, 1)``. NaN for participants without a value at some level: they are
        sampled like others and excluded from the test, as people who drop out will be.
    weights
        How a participant's means make the number that is tested, shape ``(n_levels,)``: slope or
        difference.
    groups
        Where the factor is between participants, each one's level: 0, 1, or -1 for a group that is
        not compared.
    strata
        Of which group of the study each participant is, as a number from 0: as many are drawn of
        each.
    left_out
        Participants without a value at some level, by name.
    """

    means: FloatArray
    weights: FloatArray
    groups: npt.NDArray[np.intp] | None
    strata: npt.NDArray[np.intp]
    left_out: tuple[str, ...]


def make_pool(
    movements: "pd.DataFrame", effect: Effect, people: Mapping[str, str] | None = None
) -> Pool:
    """Return a pool from the movements of all participants.

    Parameters
    ----------
    movements
        Those without results included: participants who have no others stay in the pool.
    people
        All participants who began, and their group, including those without any movement; by
        default, the participants with movements.

    Raises
    ------
    ProtocolError
        The movements have no such measure, factor or level, or the factor has one level, or more
        than two words; or a logarithm is asked for of what has none.
    """
    import pandas as pd

    for name in (effect.measure, effect.factor):
        if name not in movements:
            raise ProtocolError(
                f"movements have no {name!r}; they have {', '.join(map(str, movements))}"
            )
    results = movements[is_result(movements)]
    table = results[["participant", effect.factor, effect.measure]].dropna()
    cells = _cells(table, effect)
    numeric = not effect.between and pd.api.types.is_numeric_dtype(cells.columns)
    steps = cells.columns.to_numpy(float) if numeric else np.array([0.0, 1.0])
    steps = steps - steps.mean()
    own = pd.Series(dict(people or people_of(movements)), dtype=object).sort_index()
    if (cells.notna().sum(axis=1) == 1).all():
        return _between(movements, cells, effect, own)
    whole = cells.dropna().reindex(own.index)
    strata, _ = pd.factorize(own, sort=True)
    weights = steps / (steps @ steps)
    return Pool(whole.to_numpy(float), weights, None, strata, _without(whole.iloc[:, 0]))


def people_of(movements: "pd.DataFrame") -> dict[str, str]:
    """Return all participants with a movement, and their group; "" without groups."""
    if GROUP not in movements:
        return dict.fromkeys(movements["participant"].unique(), "")
    return dict(movements.groupby("participant")[GROUP].first())


def _cells(table: "pd.DataFrame", effect: Effect) -> "pd.DataFrame":
    """Return participants' means at each level; of two that are compared, in their order."""
    import pandas as pd

    levels = sorted(table[effect.factor].unique())
    if effect.between:
        levels = pair_of(effect, levels)
        table = table[table[effect.factor].isin(levels)]
    if effect.log:
        values = _logarithms(table[effect.measure].to_numpy(float), effect)
        table = table.assign(**{effect.measure: values})
    numeric = pd.api.types.is_numeric_dtype(table[effect.factor])
    if len(levels) < 2 or (len(levels) > 2 and not numeric):  # noqa: PLR2004
        raise ProtocolError(
            f"{effect.factor!r} has {len(levels)} levels here ({', '.join(map(str, levels))}); "
            "the test is for a number with two or more, or for two words, as in "
            f"{effect.factor}[one,other]"
        )
    means = table.groupby(["participant", effect.factor])[effect.measure].mean()
    return means.unstack().reindex(columns=levels)


def pair_of(effect: Effect, levels: Sequence[object]) -> "list[object]":
    """Return the two levels that are compared, of those that there are, in the effect's order.

    Raises
    ------
    ProtocolError
        One is not there, or both are the same.
    """
    # A level's name may have commas in it, and blanks beside them that were taken away.
    written = ",".join(effect.between)
    named = {_BLANKS.sub(r"\1", word(level)): level for level in levels}
    for one, level in named.items():
        if written.startswith(f"{one},") and (other := written[len(one) + 1 :]) in named:
            if one == other:
                raise ProtocolError(
                    f"{effect.factor}[{written}] compares {one!r} with itself; name two of "
                    f"{', '.join(named)}"
                )
            return [level, named[other]]
    unknown = next((each for each in effect.between if each not in named), written)
    raise ProtocolError(
        f"{effect.factor} has no level {unknown!r}; it has {', '.join(map(word, levels))}"
    )


def _between(
    movements: "pd.DataFrame", cells: "pd.DataFrame", effect: Effect, people: "pd.Series[str]"
) -> Pool:
    """Return a pool whose factor is between participants."""
    import pandas as pd

    if effect.factor == GROUP:
        own = people
    else:
        known = movements.dropna(subset=[effect.factor]).groupby("participant")[effect.factor]
        own = known.first().reindex(sorted(movements["participant"].unique()))
        own = own[own.notna()]
    strata, _ = pd.factorize(own, sort=True)
    labels = cells.columns.get_indexer(pd.Index(own))
    means = cells.mean(axis=1).reindex(own.index)
    left_out = _without(means[labels >= 0])
    return Pool(means.to_numpy(float)[:, None], np.ones(1), labels, strata, left_out)


def _without(values: "pd.Series[float]") -> tuple[str, ...]:
    """Return the participants who have none."""
    return tuple(map(str, values.index[values.isna()]))


def _logarithms(values: FloatArray, effect: Effect) -> FloatArray:
    if none := int((values <= 0.0).sum()):
        raise ProtocolError(
            f"log({effect.measure}): {none} of {len(values)} values are 0 or less, which have no "
            f"logarithm; write {effect.measure}~{effect.factor}"
        )
    return np.log(values)


@dataclass(frozen=True, slots=True)
class Power:
    """How often the test found something in cohorts of one size.

    Attributes
    ----------
    participants, cohorts
        How many in a cohort, those who drop out included, and how many cohorts.
    power, power_low, power_high
        Share of the cohorts with p below :data:`ALPHA`, and its 95 % interval
        (:func:`labcrane.simulation.share.share_of`).
    null, null_low, null_high
        The same with the labels permuted: how often something is found where nothing is. For
        equivalence and non-inferiority, with an effect as large as the margin put in.
    type_m, type_s
        Of the cohorts in which something was found: by what the effect is overstated on average,
        and in which share it has the wrong sign (Gelman and Carlin 2014). NaN where nothing was
        found, or where there is no effect to overstate.
    """

    participants: int
    cohorts: int
    power: float
    power_low: float
    power_high: float
    null: float
    null_low: float
    null_high: float
    type_m: float
    type_s: float


def power(
    pool: Pool,
    effect: Effect,
    sizes: Sequence[int],
    cohorts: int,
    seed: int,
    *,
    fresh: bool = False,
    claim: Claim = DIFFERENCE,
) -> Iterator[Power]:
    """Yield the power of the test for each size of the cohort.

    Parameters
    ----------
    cohorts
        How many are drawn for each size; fresh ones are as many as the pool has at most.
    fresh
        Whether cohorts are made of participants of their own, in the pool's order, rather than
        drawn with replacement.
    claim
        What is to be shown.

    Raises
    ------
    ProtocolError
        The pool has too few participants.
    """
    for number, size in enumerate(sizes):
        random = np.random.default_rng([seed, number])
        drawn = _fresh(pool, size, cohorts) if fresh else _drawn(pool, size, cohorts, random)
        plain = pool.means[drawn]
        labels = None if pool.groups is None else pool.groups[drawn]
        tested = _tested(plain, labels, pool)
        true = there = _effect_of(pool)
        if claim.margin:
            null = tested.moved(claim.margin - there)
        else:
            null = _tested(*_permuted(plain, labels, random), pool)
        if effect.size is not None:
            tested, true = tested.moved(effect.size - there), effect.size
        if claim.kind != "difference":
            true = 0.0
        yield summarise(
            size,
            Outcomes(claim.p(tested), tested.estimate),
            Outcomes(claim.p(null)),
            true,
            None if fresh else drawn,
            len(pool.means),
        )


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Results of tests of cohorts; shapes ``(cohorts,)``.

    Attributes
    ----------
    p
        NaN where there was no test.
    estimates
        The effect in each; nothing where it is not asked for.
    """

    p: FloatArray
    estimates: FloatArray | None = None

    @property
    def found(self) -> npt.NDArray[np.bool_]:
        """Whether something was shown."""
        return self.p < ALPHA

    def share(self, drawn: npt.NDArray[np.intp] | None, pool: int) -> tuple[float, float, float]:
        """Return the share of cohorts in which it was, and its interval."""
        from scipy.stats import norm

        # No test is as good as one that says nothing; a p that is rounded to 0 has a score, too.
        score = norm.isf(np.maximum(np.nan_to_num(self.p, nan=1.0), np.finfo(float).tiny) / 2.0)
        return share_of(self.found, score, drawn, pool)


def summarise(
    size: int,
    plain: Outcomes,
    null: Outcomes,
    true: float,
    drawn: npt.NDArray[np.intp] | None,
    pool: int,
) -> Power:
    """Return the power from the tests of each cohort, with the effect and without it.

    Parameters
    ----------
    true
        The true effect; 0 or NaN where exaggeration is not defined.
    drawn, pool
        The participants sampled for each cohort, shape ``(cohorts, size)``, and the size of the
        pool; None where no participant is in two cohorts.
    """
    wrong = np.nan, np.nan
    if true and true == true and plain.estimates is not None and plain.found.any():  # noqa: PLR0124 - NaN is not itself
        seen = plain.estimates[plain.found]
        wrong = float(np.abs(seen).mean() / abs(true)), float((seen * true < 0.0).mean())
    return Power(size, len(plain.p), *plain.share(drawn, pool), *null.share(drawn, pool), *wrong)


def _effect_of(pool: Pool) -> float:
    """Return the effect in the whole pool, in its unit; each group has the same weight."""
    numbers = pool.means @ pool.weights
    if pool.groups is None:
        there = np.isfinite(numbers)
        weights = 1.0 / np.bincount(pool.strata)[pool.strata]
        return float(np.average(numbers[there], weights=weights[there]))
    one, other = (float(np.nanmean(numbers[pool.groups == group])) for group in (0, 1))
    return other - one


def _drawn(
    pool: Pool, size: int, cohorts: int, random: np.random.Generator
) -> npt.NDArray[np.intp]:
    """Draw cohorts with replacement, from each group as many; shape ``(cohorts, size)``."""
    strata = int(pool.strata.max()) + 1
    parts = []
    for stratum in range(strata):
        members = np.flatnonzero(pool.strata == stratum)
        count = (size + stratum) // strata
        parts.append(members[random.integers(len(members), size=(cohorts, count))])
    return np.concatenate(parts, axis=1)


def _fresh(pool: Pool, size: int, cohorts: int) -> npt.NDArray[np.intp]:
    there = min(cohorts, len(pool.means) // size)
    if there < 2:  # noqa: PLR2004
        raise ProtocolError(
            f"two cohorts of {size} need {2 * size} participants, and the pool has "
            f"{len(pool.means)}; simulate more of them"
        )
    return np.arange(there * size).reshape(there, size)


def _permuted(
    means: FloatArray, labels: npt.NDArray[np.intp] | None, random: np.random.Generator
) -> tuple[FloatArray, npt.NDArray[np.intp] | None]:
    """Permute levels within each participant, or groups over participants."""
    if labels is None:
        return random.permuted(means, axis=2), None
    compared = labels >= 0
    by_chance = np.argsort(np.where(compared, random.random(labels.shape), 2.0), axis=1)
    places = np.argsort(~compared, axis=1, kind="stable")
    mixed = labels.copy()  # participants of a third group stay there
    np.put_along_axis(mixed, places, np.take_along_axis(labels, by_chance, axis=1), axis=1)
    return means, mixed


def _tested(means: FloatArray, labels: npt.NDArray[np.intp] | None, pool: Pool) -> Tested:
    """Return the effect of each cohort: of one sample, or Welch's of two."""
    numbers = means @ pool.weights
    if labels is None:
        count, mean, square = _moments(numbers)
        error = np.sqrt(square)
        # A small cohort may be the same participant again and again: its error is rounding.
        largest = np.abs(np.nan_to_num(numbers)).max(axis=1)
        error = np.where(error < ROUNDING * largest, np.nan, error)
        return Tested(mean, error, count - 1.0)
    (_, one, _), (_, other, _) = both = [
        _moments(np.where(labels == group, numbers, np.nan)) for group in (0, 1)
    ]
    squares, freedoms = [each[2] for each in both], [each[0] - 1.0 for each in both]
    with np.errstate(invalid="ignore", divide="ignore"):
        total = squares[0] + squares[1]
        freedom = total**2 / (squares[0] ** 2 / freedoms[0] + squares[1] ** 2 / freedoms[1])
    return Tested(other - one, np.sqrt(total), freedom)


def _moments(numbers: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how many of each cohort have a number, their mean, and its squared standard error.

    NaN where too few have one; shapes ``(cohorts,)``.
    """
    there = np.isfinite(numbers)
    count = there.sum(axis=1).astype(float)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(there, numbers, 0.0).sum(axis=1) / count
        apart = np.where(there, numbers - mean[:, None], 0.0)
        square = (apart**2).sum(axis=1) / np.where(count > 1.0, count - 1.0, np.nan) / count
    return count, mean, square
