"""Analysis of variance of designs within, between and of both, and contrasts of their means."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, product
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis.statistics.trends import LEAST, holm
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

NO_VARIANCE = 1e-20
"""Share of all squares that rounding leaves where participants are all alike."""

LEAST_SHARE = 1e-9
"""Share of a level's effect, and of the largest singular value, below which it is rounding."""


@dataclass(frozen=True, slots=True)
class Anova:
    """The test of one effect.

    Attributes
    ----------
    measure, factor
        The measure and the factor; an interaction's factors are joined by colons.
    f
        The F ratio.
    df1, df2
        Degrees of freedom, not corrected.
    epsilon
        Greenhouse and Geisser's; multiplies both degrees of freedom. 1 between participants.
    epsilon_hf
        Huynh and Feldt's, at most 1.
    p, p_gg
        Without a correction, and with Greenhouse and Geisser's.
    eta2p
        Partial eta squared, F·df1 / (F·df1 + df2).
    n
        Participants.
    people
        Participants in the test: they have a value in every cell, and are not alone in a group.
    beside
        The column that the effect was adjusted for; empty without adjustment.
    confounded
        What the effect cannot be distinguished from, in words; empty if nothing, or not tested.
    """

    measure: str
    factor: str
    f: float
    df1: float
    df2: float
    epsilon: float
    epsilon_hf: float
    p: float
    p_gg: float
    eta2p: float
    n: int
    people: tuple[str, ...]
    beside: str = ""
    confounded: str = ""


@dataclass(frozen=True, slots=True)
class Contrast:
    """The difference of two means.

    Attributes
    ----------
    measure, factor
        The measure and the factor.
    at
        The level of another factor; "" for the mean over its levels.
    first, second
        The two levels.
    difference, ci_low, ci_high
        First minus second, with its 95 % confidence interval, in the measure's unit.
    se, df, t, p
        The two-sided t test, with a variance of its own within participants.
    p_holm
        The same corrected for the differences of one family: those of a factor, at one level.
    n
        Participants.
    people
        Their names.
    beside
        The column that the difference was adjusted for; empty without adjustment.
    confounded
        What the difference cannot be distinguished from, in words; empty if nothing, or not tested.
    """

    measure: str
    factor: str
    at: str
    first: str
    second: str
    difference: float
    ci_low: float
    ci_high: float
    se: float
    df: float
    t: float
    p: float
    p_holm: float
    n: int
    people: tuple[str, ...]
    beside: str = ""
    confounded: str = ""


@dataclass(frozen=True)
class FactorialDesign:
    """Participants' means in the cells of a design, and the model between participants.

    Attributes
    ----------
    values
        One row per whole participant, one column per cell; the last factor changes fastest.
    within, between
        Levels by factor.
    model
        Intercept and sum-to-zero columns of the factors between, one row per participant.
    terms
        Columns of the model by term; ``()`` is the intercept.
    beside
        Shares of what is adjusted for in each cell, sum-to-zero: participants, cells, columns.
    people
        Participants of the rows, in their order: they have a value in every cell.
    alone
        Those who have, too, and are left out, since they are alone in a group or in none.
    empty
        Cells in which no participant has a value.
    """

    values: FloatArray
    within: dict[str, tuple[Any, ...]]
    between: dict[str, tuple[Any, ...]]
    model: FloatArray
    terms: dict[tuple[str, ...], list[int]]
    beside: FloatArray
    people: tuple[str, ...]
    alone: tuple[str, ...]
    empty: tuple[tuple[Any, ...], ...]

    @property
    def testable(self) -> bool:
        """Whether there are participants enough for their variance and for all groups."""
        if len(self.people) < LEAST or self.free < 1:
            return False
        return bool(np.linalg.matrix_rank(self.model) == self.model.shape[1])

    @property
    def free(self) -> int:
        """Degrees of freedom of the residuals."""
        return int(self.values.shape[0] - self.model.shape[1])

    @property
    def added(self) -> FloatArray:
        """What the adjustment takes out of the values: zero at equal shares of its levels."""
        if not self.beside.shape[2]:
            return np.zeros_like(self.values)
        made = np.hstack([_contrasts(self, inside) for inside in _subsets(list(self.within))][1:])
        adds = np.einsum("pcq,cd->pdq", self.beside, made)
        weights = _rest(self.model, self.values @ made, adds)[2]
        return np.asarray(self.beside @ weights)


def design(
    table: "pd.DataFrame",
    measure: str,
    within: Sequence[str],
    between: Sequence[str],
    beside: str = "",
    period: str = "",
) -> FactorialDesign:
    """Return the cells of a design, perhaps with too few participants for a test.

    A participant's value in a cell is the mean over their rows there. Levels without a value, and
    factors of one level, have no cells. Who is alone in a group is left out.

    Parameters
    ----------
    beside, period
        A column whose levels are adjusted for: of ``beside`` each row has its share in a cell, of
        ``period`` each level that a participant has there, so that a lost row changes no share.
    """
    known = table.dropna(subset=[measure])
    levels = _levels(known, within)
    wide = _cells(known, known[measure], levels)
    whole = wide.dropna()
    who = known.groupby("participant")[list(between)].first().loc[whole.index]
    single: set[Any] = set()
    if between:
        single = alone(dict(zip(who.index, who.itertuples(index=False), strict=True)))
        whole, who = (each.drop(index=list(single)) for each in (whole, who))
    groups = {name: tuple(sorted(who[name].unique())) for name in between}
    groups = {name: own for name, own in groups.items() if len(own) > 1}
    model, terms = _model(who, groups)
    rows = known.drop_duplicates(["participant", *levels, period]) if period else known
    shares = _shares(rows, beside or period, levels, whole.index)
    people, single_people = (tuple(map(str, each)) for each in (whole.index, sorted(single)))
    lacking = zip(wide.columns, wide.isna().to_numpy().T, strict=True)
    empty: list[Any] = [cell for cell, lacks in lacking if len(lacks) and lacks.all()]
    cells = tuple(cell if isinstance(cell, tuple) else (cell,) for cell in empty)
    return FactorialDesign(
        whole.to_numpy(float), levels, groups, model, terms, shares, people, single_people, cells
    )


def alone(groups: Mapping[Any, Any]) -> set[Any]:
    """Return who is in no group, or is the only one of theirs: a group of one has no variance.

    Parameters
    ----------
    groups
        The group of each participant, or their levels of several factors; "" is none.
    """
    counts = Counter(groups.values())
    return {who for who, own in groups.items() if counts[own] == 1 or "" in (own, *own)}


def _levels(known: "pd.DataFrame", within: Sequence[str]) -> dict[str, tuple[Any, ...]]:
    """Return the levels of factors that have more than one."""
    levels = {name: tuple(sorted(known[name].unique())) for name in within}
    return {name: own for name, own in levels.items() if len(own) > 1}


def _cells(
    known: "pd.DataFrame", values: "pd.Series[float]", levels: dict[str, tuple[Any, ...]]
) -> "pd.DataFrame":
    """Return means of participants, which are rows, in cells, which are columns."""
    import pandas as pd

    within = list(levels)
    means = values.groupby([known["participant"], *(known[name] for name in within)]).mean()
    if not within:
        return means.to_frame()
    every = pd.MultiIndex.from_tuples(list(product(*levels.values())), names=within)
    columns = every if len(within) > 1 else every.get_level_values(0)
    return means.unstack(within).reindex(columns=columns)


def _shares(
    known: "pd.DataFrame", beside: str, levels: dict[str, tuple[Any, ...]], who: "pd.Index[Any]"
) -> FloatArray:
    """Return sum-to-zero shares of the levels of a column in each cell, the last level left out."""
    kinds = sorted(known[beside].unique()) if beside else []
    parts = [
        _cells(known, (known[beside] == kind).astype(float), levels).loc[who].to_numpy(float)
        for kind in kinds
    ]
    if len(parts) < 2:  # noqa: PLR2004 - one level adds nothing
        cells = int(np.prod([len(own) for own in levels.values()]))
        return np.empty((len(who), cells, 0))
    return np.stack([part - parts[-1] for part in parts[:-1]], axis=2)


def _model(
    who: "pd.DataFrame", groups: dict[str, tuple[Any, ...]]
) -> tuple[FloatArray, dict[tuple[str, ...], list[int]]]:
    columns: list[FloatArray] = [np.ones(len(who))]
    terms: dict[tuple[str, ...], list[int]] = {(): [0]}
    for term in _subsets(list(groups)):
        if not term:
            continue
        coded = [_coded(who[name].to_numpy(), groups[name]).T for name in term]
        made = [np.prod(each, axis=0) for each in product(*coded)]
        terms[term] = list(range(len(columns), len(columns) + len(made)))
        columns += made
    return np.column_stack(columns), terms


def _coded(values: Any, levels: tuple[Any, ...]) -> FloatArray:
    """Return sum-to-zero columns, shape ``(n, n_levels - 1)``."""
    last = np.asarray(values == levels[-1], float)
    return np.column_stack([np.asarray(values == level, float) - last for level in levels[:-1]])


def _subsets(names: Sequence[str]) -> Iterator[tuple[str, ...]]:
    return chain.from_iterable(combinations(names, size) for size in range(len(names) + 1))


def analyse(
    table: "pd.DataFrame",
    measure: str,
    within: Sequence[str] = (),
    between: Sequence[str] = (),
    beside: str = "",
) -> list[Anova]:
    """Test every effect of a within, between or mixed design that can be tested.

    Type III sums of squares of a multivariate linear model with sum-to-zero contrasts, so that
    groups may be of unequal size (O'Brien & Kaiser 1985, Psychological Bulletin 97:316-333);
    epsilon after Greenhouse & Geisser 1959, Psychometrika 24:95-112.

    Parameters
    ----------
    table
        One row per movement or answer, with a column ``participant``.
    within, between
        Columns that vary within and between participants.
    beside
        A column whose levels every effect is adjusted for: an analysis of covariance in each
        stratum. Effects that cannot be distinguished from it are not tested.
    """
    return effects_in(design(table, measure, within, between, beside), measure, beside)


def effects_in(cells: FactorialDesign, measure: str, beside: str = "") -> list[Anova]:
    """Test every effect of a design that can be tested, as :func:`analyse` does."""
    if not cells.testable:
        return []
    found = []
    for inside in _subsets(list(cells.within)):
        made = _contrasts(cells, inside)
        seen = cells.values @ made
        adds = np.einsum("pcq,cd->pdq", cells.beside, made)
        rest, free, _ = _rest(cells.model, seen, adds)
        error = rest.T @ rest
        if free < 1 or np.trace(error) <= NO_VARIANCE * float((cells.values**2).sum()):
            continue  # all are alike: nothing to compare with
        for outside, own in cells.terms.items():
            if not (inside or outside):
                continue
            without, more_free, _ = _rest(np.delete(cells.model, own, axis=1), seen, adds)
            if more_free - free < len(own) * len(error):
                continue
            effect = float((without**2).sum()) - float(np.trace(error))
            name = ":".join((*outside, *inside))
            test = _test(measure, name, effect, error, (more_free - free, free), cells)
            found.append(replace(test, beside=beside) if cells.beside.shape[2] else test)
    return found


def _rest(
    model: FloatArray, seen: FloatArray, adds: FloatArray
) -> tuple[FloatArray, int, FloatArray]:
    """Return the residuals of a model between participants, adjusted, and their degrees of freedom.

    The adjustment adds the same to every contrast and participant, by least squares; its weights
    are the last.
    """
    people, contrasts, size = adds.shape
    outside = np.eye(people) - model @ np.linalg.pinv(model)
    rest = outside @ seen
    free = (people - model.shape[1]) * contrasts
    columns = np.einsum("op,pdq->odq", outside, adds).reshape(people * contrasts, size)
    if not size:
        return rest, free, np.empty(0)
    columns[np.abs(columns) < LEAST_SHARE] = 0.0  # shares are of 1
    weights, _, rank, _ = np.linalg.lstsq(columns, rest.ravel(), rcond=LEAST_SHARE)
    return rest - (columns @ weights).reshape(rest.shape), free - int(rank), weights


def _contrasts(cells: FactorialDesign, inside: tuple[str, ...]) -> FloatArray:
    """Return orthonormal contrasts of an effect within participants, shape ``(cells, d)``."""
    made = np.ones((1, 1))
    for name, levels in cells.within.items():
        k = len(levels)
        mean = np.full((k, 1), k**-0.5)
        if name not in inside:
            made = np.kron(made, mean)
            continue
        helmert, _ = np.linalg.qr(np.column_stack([mean, np.eye(k)[:, 1:]]))
        made = np.kron(made, helmert[:, 1:])
    return made


def _test(
    measure: str,
    name: str,
    effect: float,
    error: FloatArray,
    free: tuple[int, int],
    cells: FactorialDesign,
) -> Anova:
    from scipy.stats import f as distribution

    size = len(error)
    df1, df2 = map(float, free)
    f = (effect / df1) / (float(np.trace(error)) / df2)
    epsilon = float(np.trace(error) ** 2 / (size * (error**2).sum()))
    return Anova(
        measure,
        name,
        f,
        df1,
        df2,
        epsilon,
        _huynh_feldt(epsilon, cells.free, size),
        p=float(distribution.sf(f, df1, df2)),
        p_gg=float(distribution.sf(f, epsilon * df1, epsilon * df2)),
        eta2p=f * df1 / (f * df1 + df2),
        n=len(cells.values),
        people=cells.people,
    )


def _huynh_feldt(epsilon: float, free: int, size: int) -> float:
    if size == 1 or free <= size * epsilon:
        return 1.0
    return min(1.0, ((free + 1.0) * size * epsilon - 2.0) / (size * (free - size * epsilon)))


def compare(
    table: "pd.DataFrame",
    measure: str,
    factor: str,
    within: Sequence[str] = (),
    between: Sequence[str] = (),
    at: str = "",
    period: str = "",
) -> list[Contrast]:
    """Compare the levels of one factor pairwise, corrected after Holm.

    The means are those of the whole design, every cell weighted alike; each difference has the
    variance of its own participants' differences, as in a multivariate model.

    Parameters
    ----------
    at
        A factor within participants; the comparison is made separately at each of its levels.
    period
        A column whose effect is taken out of each difference, where it can be told from it.
    """
    cells = design(table, measure, within, between, period=period)
    if not cells.testable or factor not in {**cells.within, **cells.between}:
        return []
    places = cells.within.get(at, (None,))
    found = []
    for place in places:
        chosen = {} if place is None else {at: place}
        rows = []
        levels = cells.within.get(factor) or cells.between[factor]
        for first, second in combinations(levels, 2):
            if factor in cells.within:
                weights = _mean(cells, chosen | {factor: first})
                weights -= _mean(cells, chosen | {factor: second})
                asked = np.eye(cells.model.shape[1])[0]
            else:
                weights = _mean(cells, chosen)
                asked = np.zeros(cells.model.shape[1])
                both = _coded(np.array([first, second]), cells.between[factor])
                asked[cells.terms[(factor,)]] = both[0] - both[1]
            rows.append((first, second, *_difference(cells, weights, asked)))
        corrected = holm([one[-1] for _, _, one, _ in rows])
        found += [
            Contrast(
                *(measure, factor, word(place), word(first), word(second)),
                *one,
                p_holm,
                len(cells.people),
                cells.people,
                period if adjusted else "",
            )
            for (first, second, one, adjusted), p_holm in zip(rows, corrected, strict=True)
        ]
    return found


def marginal_means(cells: FactorialDesign, columns: Sequence[str]) -> dict[tuple[Any, ...], float]:
    """Return the mean at each level of an effect: what its test compares.

    Every other cell, of groups too, is weighted alike, however many people are in it, and so are
    the levels of what is adjusted for.
    """
    weights = np.linalg.pinv(cells.model) @ (cells.values - cells.added)
    levels = [(cells.within.get(name) or cells.between[name]) for name in columns]
    found = {}
    for at in product(*levels):
        chosen = dict(zip(columns, at, strict=True))
        asked = np.zeros(cells.model.shape[1])
        for term, own in cells.terms.items():
            if set(term) <= set(chosen):
                coded = [_coded(np.array([chosen[name]]), cells.between[name])[0] for name in term]
                asked[own] = [np.prod(each) for each in product(*coded)]
        found[at] = float(asked @ weights @ _mean(cells, chosen))
    return found


def word(level: Any) -> str:
    """Return a level's name in contrasts."""
    return "" if level is None else f"{level:g}" if isinstance(level, float) else str(level)


def _mean(cells: FactorialDesign, chosen: dict[str, Any]) -> FloatArray:
    """Return weights of the cells for the mean over all that have the chosen levels."""
    made = np.ones(1)
    for name, levels in cells.within.items():
        wanted = np.array([level == chosen.get(name, level) for level in levels], float)
        made = np.kron(made, wanted / wanted.sum())
    return made


def _difference(
    cells: FactorialDesign, weights: FloatArray, asked: FloatArray
) -> tuple[tuple[float, float, float, float, float, float, float], bool]:
    """Return the estimate, its interval, error, df, t and p, and whether it is adjusted."""
    from scipy.stats import t as distribution

    seen, people = cells.values @ weights, len(cells.values)
    adds = np.einsum("pcq,c->pq", cells.beside, weights)
    adds[np.abs(adds) < LEAST_SHARE] = 0.0
    model = np.column_stack([cells.model, adds])
    wanted = np.concatenate([asked, np.zeros(adds.shape[1])])
    inverse = np.linalg.pinv(model, rcond=LEAST_SHARE)
    free = people - int(np.linalg.matrix_rank(model, tol=LEAST_SHARE * np.linalg.norm(model)))
    adjusted = bool(adds.any())
    if adjusted and (free < 1 or not np.allclose(wanted @ inverse @ model, wanted)):
        return _difference(replace(cells, beside=cells.beside[:, :, :0]), weights, asked)
    own = wanted @ inverse
    estimate = float(own @ seen)
    rest = seen - model @ (inverse @ seen)
    se = float(np.sqrt((rest @ rest) / free * (own @ own)))
    alike = rest @ rest <= NO_VARIANCE * float((cells.values**2).sum())
    t = float("nan") if alike else estimate / se
    reach = float(distribution.ppf(0.975, free)) * se
    p = float(2.0 * distribution.sf(abs(t), free))
    return (estimate, estimate - reach, estimate + reach, se, float(free), t, p), adjusted
