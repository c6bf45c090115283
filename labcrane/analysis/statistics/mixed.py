"""Linear mixed model of a measure of each movement, with the random terms of the design.

People differ in every effect that varies within them, so each has a variance over people (Barr,
Levy, Scheepers & Tily 2013, Journal of Memory and Language 68:255): without it, movements of one
person would count as independent tests of the effect. Fitted as lme4 fits it (Bates, Mächler,
Bolker & Walker 2015, Journal of Statistical Software 67:1): the restricted likelihood is profiled
over all but the variances relative to the residual.

The random terms weight the movements; the tests do not assume that they are true. The standard
error of a term is of the variation, over participants, of each one's own part in it: the robust
variance CR2 of Bell & McCaffrey 2002 (Survey Methodology 28:169), with their degrees of freedom
(Pustejovsky & Tipton 2018, Journal of Business & Economic Statistics 36:672). In a balanced
complete design this is the t test of each participant's own difference.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis.statistics.anova import alone
from labcrane.analysis.statistics.confounding import dummies
from labcrane.analysis.statistics.rounding import alike
from labcrane.analysis.statistics.trends import LEAST
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

FIXED = ("sequence", "difficulty", "far_side")
"""Fixed terms of the model; one that does not vary is left out."""

DESIGN = ("group", "phase", "condition")
"""Further ones where a study has them; groups may change in another way too."""

RANDOM = {
    "of_session": "participant:session", "of_block": "participant:block",
    "condition": "participant:condition", "phase": "participant:phase",
    "sequence": "participant", "far_side": "participant:far_side", "difficulty": "participant",
}  # fmt: skip
"""What people may differ over: columns and groupings, the first preferred where two coincide."""

NO_CONDITION = "no condition"
"""Level of blocks without a condition, beside others that have one."""

TIMES = (
    "movement_time", "onset_to_rest", "circle_to_circle", "reaction_time", "movement_onset",
    "main_stroke_time",
)  # fmt: skip
"""Times are above 0 and skewed to the right: their logarithm is modelled."""

DEPENDENT = 1e-8
"""Residual share of a column given those before it; below it, it is linearly dependent."""

LEAST_SCATTER = 1e-5
"""Share of the values' standard deviation; below it, rounding spoils the sums of squares."""

FLAT = 1e-7
"""Negligible difference of deviance: a variance that improves it by less is zero."""

STARTS = (1.0, 0.05)
"""Start values of the variances over the residual; the best result is used."""

ONE_PERSON = 1e-6
"""Share of a term's variance over people that is not observed where it rests on one of them."""


class NoModelError(Exception):
    """A model cannot be fitted; the message gives the reason."""


@dataclass(frozen=True, slots=True)
class MixedModel:
    """A linear mixed model of a measure, or of its logarithm.

    Fixed are ``sequence + difficulty + far_side``, the two numbers centred; with groups also
    ``group * sequence``, with sessions or blocks ``phase``, within participants ``condition``, each
    by group. Random are the participant, and participant by each of these that varies within
    people, and by session and block where each session has the same blocks. They are independent,
    each with one variance.

    A random term is in the model if it adds to those before it within people and leaves movements
    for the residual; one whose variance is estimated as zero is then left out, which changes no
    estimate. Terms of levels are differences from the first level, so that ``sequence``, ``phase``
    and ``condition`` are those of the first group where there are several.

    Attributes
    ----------
    measure
        The modelled measure.
    log
        Whether its logarithm was: of :data:`TIMES`, unless a value is 0 or less. Other measures are
        modelled untransformed, since they have a sign, or a value of 0 that means something.
    formula
        The fitted model as lme4 writes it.
    terms
        One row per fixed term: term, estimate, robust standard error, t, degrees of freedom, p,
        and the terms left out that it cannot be distinguished from. The errors and tests of a term
        that rests on one participant are nan.
    dropped
        Terms that follow from the others here, as where one group lacks one phase; not estimated.
    random
        Standard deviation over participants of each random term, of the logarithm if ``log``.
    zero
        Random terms left out because their variance is estimated as zero.
    inseparable
        Random terms left out because they coincide with others or with the residual.
    residual_sd
        That of the residuals.
    criterion
        The restricted deviance at the fit, as lme4 prints it; the lower, the better.
    n, participants
        Movements and participants.
    missing
        Movements without a value, which are left out.
    alone
        Participants who are left out since they are alone in a group, or in none beside others.
    reference
        The first group, where there are several; otherwise empty.
    """

    measure: str
    log: bool
    formula: str
    terms: "pd.DataFrame"
    dropped: tuple[str, ...]
    random: Mapping[str, float]
    zero: tuple[str, ...]
    inseparable: tuple[str, ...]
    residual_sd: float
    criterion: float
    n: int
    participants: int
    missing: int
    alone: tuple[str, ...]
    reference: str = ""


def mixed_model(movements: "pd.DataFrame", measure: str) -> MixedModel:
    """Fit the mixed model by REML. Participants with missing movements stay in.

    Raises
    ------
    NoModelError
        With fewer than three participants, too few movements, values that are infinite or all the
        same, or none that scatters about the terms and the participants' own means and slopes.
    """
    import pandas as pd
    from scipy.stats import t as distribution

    movements, gone = _in_company(movements, measure)
    data, log = _modelled(movements, measure)
    people = data["participant"].nunique()
    if people < LEAST:
        raise NoModelError(f"{people} participants have a value, and {LEAST} are needed")
    y = data["y"].to_numpy(float)
    if not np.isfinite(y).all():
        raise NoModelError("some values are infinite")
    if alike(y):
        raise NoModelError("all movements have the same value")
    names, columns = _columns(data)
    kept, behind = _independent(columns)
    x = columns[:, kept]
    ones = [np.asarray(rows) for rows in data.groupby("participant").indices.values()]
    random, inseparable = _estimable(_of_people(data), x, ones)
    if not random:
        raise NoModelError(
            f"{len(data)} movements of {people} participants are too few for a mean of each"
        )
    scatter = _scatter(x, y, np.column_stack(list(random.values())), ones)
    if scatter <= LEAST_SCATTER * float(y.std()):
        raise NoModelError(
            "the terms and each participant's means and slopes fit every value exactly; no "
            "residual variance is left to test against"
        )
    fit = _Fit(x, y, list(random.values()), ones, scatter)
    errors, freedom = fit.errors_and_freedom
    t = fit.estimates / errors
    terms = pd.DataFrame(
        {
            "term": [names[at] for at in kept],
            "estimate": fit.estimates,
            "se": errors,
            "t": t,
            "df": freedom,
            "p": 2.0 * distribution.sf(np.abs(t), freedom),
            "confounded": [
                " and ".join(names[left] for left, own in behind.items() if at in own)
                for at in kept
            ],
        }
    )
    groups = sorted(data["group"].unique()) if "group" in data else []
    deviations = dict(zip(random, fit.deviations.tolist(), strict=True))
    there = {name: value for name, value in deviations.items() if value > 0.0}
    response = f"log({measure})" if log else measure
    fixed = dict.fromkeys(_plain(name) for name in terms["term"][1:])
    return MixedModel(
        measure,
        log,
        f"{response} ~ {' + '.join([*fixed, *there]) or '1'}",
        terms,
        dropped=tuple(names[at] for at in behind),
        random=there,
        zero=tuple(name for name in deviations if name not in there),
        inseparable=inseparable,
        residual_sd=float(fit.sigma),
        criterion=fit.criterion,
        n=len(data),
        participants=people,
        missing=len(movements) - len(data),
        alone=gone,
        reference=str(groups[0]) if len(groups) > 1 else "",
    )


def _plain(term: str) -> str:
    """Return ``group:phase`` of ``group[T.visual]:phase[T.second]``."""
    return re.sub(r"\[T\.[^\]]*\]", "", term)


def _in_company(movements: "pd.DataFrame", measure: str) -> tuple["pd.DataFrame", tuple[str, ...]]:
    """Return the movements without those of people who are alone in a group, and who they are."""
    if "group" not in movements:
        return movements, ()
    groups = movements.dropna(subset=[measure]).groupby("participant")["group"].first()
    gone = alone(dict(groups)) if groups.nunique() > 1 else set()
    return movements[~movements["participant"].isin(gone)], tuple(sorted(map(str, gone)))


def _modelled(movements: "pd.DataFrame", measure: str) -> tuple["pd.DataFrame", bool]:
    """Return the model's data, numbers centred, and whether it is of the logarithm."""
    own = [name for name in dict.fromkeys([*DESIGN, *RANDOM]) if name in movements]
    names = list(dict.fromkeys([*FIXED, *own, "participant"]))
    table = movements[[measure, *names]]
    if "condition" in names:
        table = table.fillna({"condition": ""}).replace({"condition": {"": NO_CONDITION}})
    table = table.dropna()
    log = measure in TIMES and bool((table[measure] > 0.0).all())
    data = table[names].assign(y=np.log(table[measure]) if log else table[measure])
    for name in ("sequence", "difficulty"):
        data[name] -= data[name].mean()
    return data.reset_index(drop=True), log


def _columns(data: "pd.DataFrame") -> tuple[list[str], FloatArray]:
    """Return the fixed terms' names and columns, the intercept first."""
    coded = {
        name: _coded(name, data[name])
        for name in (*FIXED, *DESIGN)
        if name in data and data[name].nunique() > 1
    }
    terms = {"Intercept": np.ones(len(data))}
    for own in coded.values():
        terms |= own
    for name in ("sequence", "phase", "condition"):
        if {"group", name} <= set(coded):
            terms |= {
                f"{group}:{other}": one * two
                for other, two in coded[name].items()
                for group, one in coded["group"].items()
            }
    return list(terms), np.column_stack(list(terms.values()))


def _is_number(values: "pd.Series[Any]") -> bool:
    from pandas.api.types import is_bool_dtype, is_numeric_dtype

    return is_numeric_dtype(values) and not is_bool_dtype(values)


def _coded(name: str, values: "pd.Series[Any]") -> dict[str, FloatArray]:
    """Return a number unchanged, and one column for each level except the first."""
    if _is_number(values):
        return {name: values.to_numpy(float)}
    levels = sorted(values.unique(), key=lambda level: (level == NO_CONDITION, level))
    return {f"{name}[T.{level}]": (values == level).to_numpy(float) for level in levels[1:]}


def _independent(columns: FloatArray) -> tuple[list[int], dict[int, list[int]]]:
    """Return which columns do not follow from those before them, and what the others follow from.

    The intercept, the first, is not named.
    """
    kept: list[int] = []
    behind: dict[int, list[int]] = {}
    for at in range(columns.shape[1]):
        column, before = columns[:, at], columns[:, kept]
        weights = np.linalg.lstsq(before, column, rcond=None)[0] if kept else np.empty(0)
        if np.linalg.norm(column - before @ weights) > DEPENDENT * np.linalg.norm(column):
            kept.append(at)
        else:
            of = zip(kept, np.abs(weights).tolist(), strict=True)
            behind[at] = [one for one, weight in of if one and weight > DEPENDENT]
    return kept, behind


def _of_people(data: "pd.DataFrame") -> dict[str, FloatArray]:
    """Return the columns of one participant for each random term that the data vary in."""
    found = {"(1 | participant)": np.ones((len(data), 1))}
    of_phases = [name for name in ("of_session", "of_block") if name in data]
    levels = [data[name].nunique() for name in of_phases]
    # Sessions of unlike blocks are one factor, phase.
    crossed = min(levels, default=0) > 1 and len(data.groupby(of_phases)) == np.prod(levels)
    for name, of in RANDOM.items():
        if name not in data or (name in of_phases and not crossed):
            continue
        if _is_number(data[name]):
            found[f"(0 + {name} | {of})"] = data[[name]].to_numpy(float)
        else:
            found[f"(1 | {of})"] = dummies(data[name].factorize()[0])
    return found


def _estimable(
    terms: Mapping[str, FloatArray], x: FloatArray, ones: Sequence[Any]
) -> tuple[dict[str, FloatArray], tuple[str, ...]]:
    """Return the random terms that add to those before and leave a residual, and the others."""
    basis = np.linalg.qr(x)[0]
    kept: dict[str, FloatArray] = {}
    rank = basis.shape[1]
    for name, own in terms.items():
        rows = _outside(basis, np.column_stack([*kept.values(), own]), ones)
        now = sum(size for _, size in rows)
        rest = np.concatenate([part for part, _ in rows])
        now += int((np.linalg.eigvalsh(rest.T @ rest) > DEPENDENT).sum())
        if rank < now < len(x):
            kept[name], rank = own, now
    return kept, tuple(name for name in terms if name not in kept and np.ptp(terms[name]) > 0.0)


def _outside(
    columns: FloatArray, z: FloatArray, ones: Sequence[Any]
) -> list[tuple[FloatArray, int]]:
    """Return what each participant's own columns ``z`` leave of ``columns``, and their rank."""
    found = []
    for rows in ones:
        made, sizes, _ = np.linalg.svd(z[rows], full_matrices=False)
        made = made[:, sizes > DEPENDENT * sizes.max(initial=0.0)]
        found.append((columns[rows] - made @ (made.T @ columns[rows]), made.shape[1]))
    return found


def _scatter(x: FloatArray, y: FloatArray, z: FloatArray, ones: Sequence[Any]) -> float:
    """Return the standard deviation about the terms and people's own means and slopes."""
    parts = _outside(np.column_stack([x, y]), z, ones)
    both = np.concatenate([part for part, _ in parts])
    rest = both[:, -1] - both[:, :-1] @ np.linalg.lstsq(both[:, :-1], both[:, -1], rcond=None)[0]
    return float(np.sqrt((rest**2).mean()))


class _Fit:
    """The fit of ``y = x·b + z·u + e`` with u of each participant and e normal.

    Each random term has columns ``z`` of its own and one variance. Everything is computed from
    cross products of each participant. Columns are scaled to about 1 and ``y`` to a residual of
    about 1 before, and results are scaled back.
    """

    def __init__(
        self,
        x: FloatArray,
        y: FloatArray,
        terms: Sequence[FloatArray],
        ones: Sequence[Any],
        scatter: float,
    ) -> None:
        self._n, self._p = x.shape
        self._x, self._back = np.linalg.qr(x)
        self._y_scale = scatter
        self._z_scale = np.array([np.sqrt((own**2).sum(axis=1).mean()) for own in terms])
        self._term = np.repeat(np.arange(len(terms)), [own.shape[1] for own in terms])
        z = np.column_stack(list(terms)) / self._z_scale[self._term]
        first = self._x.T @ y
        rest = (y - self._x @ first) / self._y_scale  # better conditioned than y
        self._first = first
        self._zz = np.stack([z[own].T @ z[own] for own in ones])
        self._zx = np.stack([z[own].T @ self._x[own] for own in ones])
        self._zy = np.stack([z[own].T @ rest[own] for own in ones])
        self._xx = np.stack([self._x[own].T @ self._x[own] for own in ones])
        self._xy = np.stack([self._x[own].T @ rest[own] for own in ones])
        self._yy = float(rest @ rest)
        self._theta = np.sqrt(self._fitted())

    def _whitened(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return each participant's Cholesky factor, and what it leaves of z'x and z'y.

        By the terms' standard deviations over the residual's.
        """
        factor = theta[self._term]
        inner = np.eye(len(factor)) + factor[:, None] * self._zz * factor
        lower: FloatArray = np.linalg.cholesky(inner)
        zx: FloatArray = np.linalg.solve(lower, factor[:, None] * self._zx)
        zy = np.asarray(np.linalg.solve(lower, (self._zy * factor)[..., None])[..., 0], float)
        return lower, zx, zy

    def _solved(self, theta: FloatArray) -> tuple[float, FloatArray, FloatArray, float]:
        """Return log determinants, x'V⁻¹x, the estimates, and the weighted sum of squares."""
        lower, zx, zy = self._whitened(theta)
        xvx = np.eye(self._p) - np.einsum("mqp,mqr->pr", zx, zx)
        xvy = -np.einsum("mqp,mq->p", zx, zy)
        estimates = np.linalg.solve(xvx, xvy)
        squares = self._yy - float((zy**2).sum()) - float(estimates @ xvy)
        logs = 2.0 * float(np.log(np.einsum("mqq->mq", lower)).sum())
        return logs + float(np.linalg.slogdet(xvx)[1]), xvx, estimates, squares

    def _profiled(self, variances: FloatArray) -> float:
        """Return the deviance at its best residual variance, but for a constant."""
        logs, _, _, squares = self._solved(np.sqrt(variances))
        return float(logs + (self._n - self._p) * np.log(squares))

    def _slope(self, variances: FloatArray) -> FloatArray:
        """Return the derivatives of the profiled deviance."""
        factor = np.sqrt(variances)[self._term]
        _, xvx, estimates, squares = self._solved(np.sqrt(variances))
        inner = np.eye(len(factor)) + factor[:, None] * self._zz * factor
        part = np.linalg.solve(inner, factor[:, None] * self._zz)  # of V⁻¹z = z - z·factor·part
        left = np.eye(len(factor)) - factor[:, None] * part
        zx = left.transpose(0, 2, 1) @ self._zx
        zy = np.einsum("mpq,mp->mq", left, self._zy) - zx @ estimates
        traces = np.einsum("mqp,mpq->mq", self._zz, left) - np.einsum(
            "mqp,mqp->mq", zx @ np.linalg.inv(xvx), zx
        )
        each = (traces - (self._n - self._p) / squares * zy**2).sum(axis=0)
        return np.asarray(np.bincount(self._term, each), float)

    def _fitted(self) -> FloatArray:
        """Return the variances over the residual's."""
        from scipy.optimize import minimize

        size = len(self._z_scale)
        ends = [
            minimize(
                self._profiled, np.full(size, start), method="L-BFGS-B", jac=self._slope,
                bounds=[(0.0, None)] * size,
                options={"ftol": 1e-14, "gtol": 1e-7, "maxiter": 1000},
            )
            for start in STARTS
        ]  # fmt: skip
        found = np.asarray(min(ends, key=lambda end: float(end.fun)).x, float)
        for at in np.argsort(found):
            edge = np.where(np.arange(size) == at, 0.0, found)
            if self._profiled(edge) <= self._profiled(found) + FLAT:
                found = edge
        return found

    @cached_property
    def _sigma(self) -> float:
        return float(np.sqrt(self._solved(self._theta)[3] / (self._n - self._p)))

    @property
    def criterion(self) -> float:
        """The restricted deviance, with its constants, in the units of ``y``."""
        free = self._n - self._p
        logs = self._solved(self._theta)[0] + 2.0 * np.log(np.abs(np.diag(self._back))).sum()
        return float(logs + free * (1.0 + np.log(2.0 * np.pi * self.sigma**2)))

    @property
    def sigma(self) -> float:
        """The residual standard deviation."""
        return self._sigma * self._y_scale

    @property
    def deviations(self) -> FloatArray:
        """Standard deviations over people of the random terms."""
        return np.asarray(self._theta * self.sigma / self._z_scale)

    @property
    def estimates(self) -> FloatArray:
        """Estimates of the fixed terms."""
        own = self._solved(self._theta)[2] * self._y_scale + self._first
        return np.linalg.solve(self._back, own)

    @cached_property
    def errors_and_freedom(self) -> tuple[FloatArray, FloatArray]:
        """Standard errors of the fixed terms and their degrees of freedom; nan if not known.

        An estimate is a sum of one part of each participant, whose squares add to its variance
        once each is enlarged by what the participant took out of the residuals.
        """
        _, zx, zy = self._whitened(self._theta)
        of_each = self._xx - zx.transpose(0, 2, 1) @ zx
        lower = np.linalg.cholesky(of_each.sum(axis=0))
        inverse = np.linalg.inv(lower)
        share = inverse @ of_each @ inverse.T  # over all participants, these add to the identity
        scores = self._xy - np.einsum("mqp,mq->mp", zx, zy)
        rest = (scores @ inverse.T) - share @ (inverse @ scores.sum(axis=0))
        sizes, axes = np.linalg.eigh(share)
        left = 1.0 - sizes
        larger = np.where(left > DEPENDENT, left.clip(DEPENDENT) ** -0.5, 0.0)
        enlarged = (axes * larger[:, None]) @ axes.transpose(0, 2, 1)
        terms = inverse @ np.linalg.inv(self._back).T
        asked = enlarged @ terms
        variances = (np.einsum("mp,mpk->mk", rest, asked) ** 2).sum(axis=0)
        # Covariances of the parts, were the random terms true.
        seen = share @ asked
        own = np.einsum("mpk,mpk->mk", asked, seen)
        cross = -np.einsum("mpk,npk->kmn", seen, seen)
        people = np.arange(len(own))
        cross[:, people, people] += own.T
        expected = np.einsum("kmm->k", cross)
        known = expected > (1.0 - ONE_PERSON) * (terms**2).sum(axis=0)
        errors = np.where(known, np.sqrt(variances) * self._y_scale, np.nan)
        return errors, np.where(known, expected**2 / (cross**2).sum(axis=(1, 2)), np.nan)
