"""Analysis of variance of designs within, between and of both, and contrasts of their means."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, combinations, product
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis.statistics.trends import holm
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

LEAST = 3
"""Participants of a test; with fewer nothing can be said of their variance."""

NO_VARIANCE = 1e-20
"""Share of all squares that rounding leaves where participants are all alike."""


@dataclass(frozen=True, slots=True)
class Anova:
    """The test of one effect.

    Attributes
    ----------
    measure, factor
        What was tested, over what; an interaction's factors are joined by colons.
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
    left_out
        Participants without a value in some cell, and therefore not in the test.
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
    left_out: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Contrast:
    """The difference of two means.

    Attributes
    ----------
    measure, factor
        What was compared, over what.
    at
        The level of another factor at which it was; "" for the mean over its levels.
    first, second
        The two levels.
    difference, ci_low, ci_high
        First minus second, with its 95 % confidence interval, in the measure's unit.
    se, df, t, p
        The two-sided t test, with a variance of its own within participants.
    p_holm
        The same corrected for the differences of one family: those of a factor, at one level.
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


@dataclass(frozen=True)
class Design:
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
        Which columns of the model are whose; ``()`` is the intercept.
    left_out
        Participants who lack a cell.
    """

    values: FloatArray
    within: dict[str, tuple[Any, ...]]
    between: dict[str, tuple[Any, ...]]
    model: FloatArray
    terms: dict[tuple[str, ...], list[int]]
    left_out: tuple[str, ...]

    @property
    def free(self) -> int:
        """Degrees of freedom of the residuals."""
        return int(self.values.shape[0] - self.model.shape[1])


def design(
    table: "pd.DataFrame", measure: str, within: Sequence[str], between: Sequence[str]
) -> Design | None:
    """Return the cells of a design; None where fewer than three whole participants are left.

    A participant's value in a cell is the mean over their rows there. A factor of one level is no
    factor.
    """
    import pandas as pd

    known = table.dropna(subset=[measure])
    within = [name for name in within if known[name].nunique() > 1]
    if within:
        levels = {name: tuple(sorted(known[name].unique())) for name in within}
        cells = known.groupby(["participant", *within])[measure].mean().unstack(within)
        names = list(product(*levels.values()))
        every = pd.MultiIndex.from_tuples(names, names=within)
        wide = cells.reindex(columns=every if len(within) > 1 else every.get_level_values(0))
    else:
        levels, wide = {}, known.groupby("participant")[measure].mean().to_frame()
    whole = wide.dropna()
    left_out = tuple(map(str, wide.index.difference(whole.index)))
    who = known.groupby("participant")[list(between)].first().loc[whole.index]
    groups = {name: tuple(sorted(who[name].unique())) for name in between}
    groups = {name: own for name, own in groups.items() if len(own) > 1}
    model, terms = _model(who, groups)
    found = Design(whole.to_numpy(float), levels, groups, model, terms, left_out)
    rank = int(np.linalg.matrix_rank(model)) if len(whole) else 0
    whole_enough = len(whole) >= LEAST and found.free >= 1 and rank == model.shape[1]
    return found if whole_enough else None


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
) -> list[Anova]:
    """Test every effect of a design within, between or mixed; none where it cannot be.

    Type III sums of squares of a multivariate linear model with sum-to-zero contrasts, so that
    groups may be of unequal size (O'Brien & Kaiser 1985, Psychological Bulletin 97:316-333);
    epsilon after Greenhouse & Geisser 1959, Psychometrika 24:95-112.

    Parameters
    ----------
    table
        One row per movement or answer, with a column ``participant``.
    within, between
        Columns that vary within and between participants.
    """
    cells = design(table, measure, within, between)
    if cells is None:
        return []
    found = []
    for inside in _subsets(list(cells.within)):
        seen = cells.values @ _contrasts(cells, inside)
        inverse = np.linalg.inv(cells.model.T @ cells.model)
        weights = inverse @ cells.model.T @ seen
        rest = seen - cells.model @ weights
        error = rest.T @ rest
        if np.trace(error) <= NO_VARIANCE * float((cells.values**2).sum()):
            continue  # all are alike: nothing to compare with
        for outside, own in cells.terms.items():
            if not (inside or outside):
                continue
            asked = weights[own]
            effect = asked.T @ np.linalg.inv(inverse[np.ix_(own, own)]) @ asked
            name = ":".join((*outside, *inside))
            found.append(_test(measure, name, effect, error, len(own), cells))
    return found


def _contrasts(cells: Design, inside: tuple[str, ...]) -> FloatArray:
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
    measure: str, name: str, effect: FloatArray, error: FloatArray, rows: int, cells: Design
) -> Anova:
    from scipy.stats import f as distribution

    size = len(error)
    df1, df2 = float(rows * size), float(cells.free * size)
    f = (float(np.trace(effect)) / df1) / (float(np.trace(error)) / df2)
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
        left_out=cells.left_out,
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
) -> list[Contrast]:
    """Compare the levels of one factor two by two, corrected after Holm.

    The means are those of the whole design, every cell weighted alike; each difference has the
    variance of its own participants' differences, as in a multivariate model.

    Parameters
    ----------
    at
        A factor within participants, at each of whose levels the comparison is made by itself.
    """
    cells = design(table, measure, within, between)
    if cells is None or factor not in {**cells.within, **cells.between}:
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
                seen = cells.values @ (weights - _mean(cells, chosen | {factor: second}))
                asked = np.eye(cells.model.shape[1])[0]
            else:
                seen = cells.values @ _mean(cells, chosen)
                asked = np.zeros(cells.model.shape[1])
                both = _coded(np.array([first, second]), cells.between[factor])
                asked[cells.terms[(factor,)]] = both[0] - both[1]
            rows.append((first, second, _difference(cells, seen, asked)))
        corrected = holm([one[-1] for _, _, one in rows])
        found += [
            Contrast(measure, factor, word(place), word(first), word(second), *one, p_holm)
            for (first, second, one), p_holm in zip(rows, corrected, strict=True)
        ]
    return found


def word(level: Any) -> str:
    """Return a level as contrasts name it."""
    return "" if level is None else f"{level:g}" if isinstance(level, float) else str(level)


def _mean(cells: Design, chosen: dict[str, Any]) -> FloatArray:
    """Return weights of the cells for the mean over all that have the chosen levels."""
    made = np.ones(1)
    for name, levels in cells.within.items():
        wanted = np.array([level == chosen.get(name, level) for level in levels], float)
        made = np.kron(made, wanted / wanted.sum())
    return made


def _difference(
    cells: Design, seen: FloatArray, asked: FloatArray
) -> tuple[float, float, float, float, float, float, float]:
    from scipy.stats import t as distribution

    inverse = np.linalg.inv(cells.model.T @ cells.model)
    weights = inverse @ cells.model.T @ seen
    rest = seen - cells.model @ weights
    estimate = float(asked @ weights)
    se = float(np.sqrt((rest @ rest) / cells.free * (asked @ inverse @ asked)))
    alike = rest @ rest <= NO_VARIANCE * float((cells.values**2).sum())
    t = float("nan") if alike else estimate / se
    reach = float(distribution.ppf(0.975, cells.free)) * se
    p = float(2.0 * distribution.sf(abs(t), cells.free))
    return estimate, estimate - reach, estimate + reach, se, float(cells.free), t, p
