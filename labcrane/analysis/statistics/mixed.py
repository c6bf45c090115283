"""Linear mixed model of a measure of each movement, with differences between people.

Fitted as lme4 fits it (Bates, Mächler, Bolker & Walker 2015, Journal of Statistical Software 67:1):
the restricted likelihood is profiled over all but the covariance of people's intercepts and slopes,
which may end at a boundary. Tests are t tests with the degrees of freedom of Satterthwaite, as
lmerTest makes them (Kuznetsova, Brockhoff & Christensen 2017, the same journal 82:13).
statsmodels has the model as well, ends without a result at a boundary, and has tests of z alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis.statistics.confounding import dummies
from labcrane.analysis.statistics.rounding import alike
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

FIXED = ("sequence", "difficulty", "far_side")
"""Fixed terms of the model; one that does not vary is left out."""

DESIGN = ("group", "phase")
"""Further ones where a study has them; groups may learn in another way too."""

TIMES = (
    "movement_time", "onset_to_rest", "circle_to_circle", "reaction_time", "movement_onset",
    "main_stroke_time",
)  # fmt: skip
"""Times are above 0 and skewed to the right: their logarithm is modelled."""

LEAST = 3
"""Participants of a model."""

DEPENDENT = 1e-8
"""Residual share of a column given those before it; below it, it is linearly dependent."""

BOUNDARY = 1e-4
"""Minimum eigenvalue of people's covariance relative to the residual; below it, it is zero."""

LEAST_SCATTER = 1e-5
"""Share of the values' standard deviation; below it, rounding spoils the sums of squares."""

FLAT = 1e-7
"""Negligible difference of deviance."""

STARTS = ((1.0, 0.0, 1.0), (0.1, 0.0, 0.1), (0.1, 0.0, 0.01))
"""Start values of the fit; the best result is used. Factors of the covariance over the residual."""


class NoModelError(Exception):
    """A model cannot be fitted; the message gives the reason."""


@dataclass(frozen=True, slots=True)
class MixedModel:
    """A linear mixed model of a measure, or of its logarithm.

    ``measure ~ sequence + difficulty + far_side + (1 + sequence | participant)``, sequence
    and difficulty centred; with groups also ``group * sequence``, with sessions or blocks
    ``phase``, with both ``group * phase``. Terms of levels are differences from the first level,
    so that ``sequence`` and ``phase`` are those of the first group where there are several.

    Attributes
    ----------
    measure
        The modelled measure.
    log
        Whether its logarithm was: of :data:`TIMES`, unless a value is 0 or less. Other measures are
        modelled untransformed, since they have a sign, or a value of 0 that means something.
    terms
        One row per fixed term: term, estimate, standard error, t, Satterthwaite's degrees of
        freedom, p.
    dropped
        Terms that follow from the others here, as where one group lacks one phase; not estimated.
    participant_sd
        Standard deviation over participants of the intercept, of the logarithm if ``log``.
    slope_sd
        That of the slopes over the sequence; NaN where everybody has a single position.
    residual_sd
        That of the residuals.
    boundary
        Whether people's intercepts and slopes have a combination without any variance (lme4 calls
        the fit singular). Estimates and tests hold; the standard deviations are at their bound.
    criterion
        The restricted deviance at the fit, as lme4 prints it; the lower, the better.
    n, participants
        Movements and participants.
    missing
        Movements without a value, which are left out.
    reference
        The first group, where there are several; otherwise empty.
    """

    measure: str
    log: bool
    terms: "pd.DataFrame"
    dropped: tuple[str, ...]
    participant_sd: float
    slope_sd: float
    residual_sd: float
    boundary: bool
    criterion: float
    n: int
    participants: int
    missing: int
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
    kept = _independent(columns)
    slopes = data["sequence"].nunique() > 1
    places = data["sequence"].to_numpy(float) if slopes else np.empty((len(data), 0))
    random = np.column_stack([np.ones(len(data)), places])
    if len(data) <= len(kept) + random.shape[1] * people:
        raise NoModelError(
            f"{len(data)} movements of {people} participants are too few for a mean and a slope of "
            "each"
        )
    who = data["participant"].factorize()[0]
    scatter = _scatter(columns[:, kept], y, random, who)
    if scatter <= LEAST_SCATTER * float(y.std()):
        raise NoModelError(
            "the terms and each participant's mean and slope fit every value exactly, so there is "
            "no residual variance to test against"
        )
    fit = _Fit(columns[:, kept], y, random, who, scatter)
    t = fit.estimates / fit.errors
    terms = pd.DataFrame(
        {
            "term": [names[at] for at in kept],
            "estimate": fit.estimates,
            "se": fit.errors,
            "t": t,
            "df": fit.freedom,
            "p": 2.0 * distribution.sf(np.abs(t), fit.freedom),
        }
    )
    groups = sorted(data["group"].unique()) if "group" in data else []
    spread = np.sqrt(np.diag(fit.covariance))
    return MixedModel(
        measure,
        log,
        terms,
        dropped=tuple(name for at, name in enumerate(names) if at not in kept),
        participant_sd=float(spread[0]),
        slope_sd=float(spread[1]) if slopes else float("nan"),
        residual_sd=float(fit.sigma),
        boundary=fit.boundary,
        criterion=fit.criterion,
        n=len(data),
        participants=people,
        missing=len(movements) - len(data),
        reference=str(groups[0]) if len(groups) > 1 else "",
    )


def _modelled(movements: "pd.DataFrame", measure: str) -> tuple["pd.DataFrame", bool]:
    """Return the model's data, terms centred, and whether it is of the logarithm."""
    names = [*FIXED, *(name for name in DESIGN if name in movements), "participant"]
    table = movements[[measure, *names]].dropna()
    log = measure in TIMES and bool((table[measure] > 0.0).all())
    data = table[names].assign(y=np.log(table[measure]) if log else table[measure])
    for name in ("sequence", "difficulty"):
        data[name] -= data[name].mean()
    return data, log


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
    for name in ("sequence", "phase"):
        if {"group", name} <= set(coded):
            terms |= {
                f"{group}:{other}": one * two
                for other, two in coded[name].items()
                for group, one in coded["group"].items()
            }
    return list(terms), np.column_stack(list(terms.values()))


def _coded(name: str, values: "pd.Series[Any]") -> dict[str, FloatArray]:
    """Return a number unchanged, and one column for each level except the first."""
    from pandas.api.types import is_bool_dtype, is_numeric_dtype

    if is_numeric_dtype(values) and not is_bool_dtype(values):
        return {name: values.to_numpy(float)}
    levels = sorted(values.unique())
    return {f"{name}[T.{level}]": (values == level).to_numpy(float) for level in levels[1:]}


def _independent(columns: FloatArray) -> list[int]:
    """Return which columns do not follow from those before them."""
    kept: list[int] = []
    for at in range(columns.shape[1]):
        column = columns[:, at]
        before = columns[:, kept]
        rest = column - before @ np.linalg.lstsq(before, column, rcond=None)[0] if kept else column
        if np.linalg.norm(rest) > DEPENDENT * np.linalg.norm(column):
            kept.append(at)
    return kept


def _scatter(x: FloatArray, y: FloatArray, z: FloatArray, who: Any) -> float:
    """Return the standard deviation about the terms and people's own means and slopes."""
    of_people = (dummies(who)[:, :, None] * z[:, None, :]).reshape(len(y), -1)
    both = np.hstack([x, of_people])
    rest = y - both @ np.linalg.lstsq(both, y, rcond=None)[0]
    return float(rest.std())


class _Fit:
    """The fit of ``y = x·b + z·u + e`` with u of each participant and e normal.

    Everything is computed from cross products of each participant. Columns are scaled to about 1
    and ``y`` to a residual of about 1 before, and results are scaled back.
    """

    def __init__(
        self, x: FloatArray, y: FloatArray, z: FloatArray, who: Any, scatter: float
    ) -> None:
        self._n, self._p = x.shape
        self._x, self._back = np.linalg.qr(x)
        self._y_scale = scatter
        self._z_scale = np.sqrt((z**2).mean(axis=0))
        z = z / self._z_scale
        first = self._x.T @ y
        rest = (y - self._x @ first) / self._y_scale  # better conditioned than y
        self._first = first
        ones = [who == one for one in range(int(who.max()) + 1)]
        self._zz = np.stack([z[own].T @ z[own] for own in ones])
        self._zx = np.stack([z[own].T @ self._x[own] for own in ones])
        self._zy = np.stack([z[own].T @ rest[own] for own in ones])
        self._yy = float(rest @ rest)
        self._theta = self._fitted()

    def _factor(self, theta: FloatArray) -> FloatArray:
        """Return the lower factor of people's covariance over the residual variance."""
        size = self._zz.shape[1]
        made = np.zeros((size, size))
        made[np.tril_indices(size)] = theta
        return made

    def _solved(self, theta: FloatArray) -> tuple[float, FloatArray, FloatArray, float]:
        """Return log determinants, x'V⁻¹x, the estimates, and the weighted sum of squares."""
        factor = self._factor(theta)
        inner = np.eye(len(factor)) + factor.T @ self._zz @ factor
        lower = np.linalg.cholesky(inner)
        zx = np.linalg.solve(lower, factor.T @ self._zx)
        zy = np.linalg.solve(lower, (self._zy @ factor)[..., None])[..., 0]
        xvx = np.eye(self._p) - np.einsum("mqp,mqr->pr", zx, zx)
        xvy = -np.einsum("mqp,mq->p", zx, zy)
        estimates = np.linalg.solve(xvx, xvy)
        squares = self._yy - float((zy**2).sum()) - float(estimates @ xvy)
        logs = 2.0 * float(np.log(np.einsum("mqq->mq", lower)).sum())
        return logs + float(np.linalg.slogdet(xvx)[1]), xvx, estimates, squares

    def _profiled(self, theta: FloatArray) -> float:
        """Return the deviance at its best residual variance, but for a constant."""
        logs, _, _, squares = self._solved(theta)
        return float(logs + (self._n - self._p) * np.log(squares))

    def _deviance(self, both: FloatArray) -> float:
        """Return the deviance by factors of the covariance and the residual deviation."""
        logs, _, _, squares = self._solved(both[:-1])
        free = self._n - self._p
        return float(logs + 2.0 * free * np.log(both[-1]) + squares / both[-1] ** 2)

    def _fitted(self) -> FloatArray:
        from scipy.optimize import minimize

        size = self._zz.shape[1]
        bounds = [(0.0, None) if row == column else (None, None)
                  for row, column in zip(*np.tril_indices(size), strict=True)]  # fmt: skip
        starts = [start if size > 1 else start[:1] for start in STARTS]
        ends = [
            minimize(
                self._profiled, np.array(start), method="L-BFGS-B", jac="3-point", bounds=bounds,
                options={"ftol": 1e-12, "gtol": 1e-6},
            )
            for start in dict.fromkeys(starts)
        ]  # fmt: skip
        theta = np.asarray(min(ends, key=lambda end: float(end.fun)).x, float)
        # The search slows down towards a boundary, along which the deviance is flat.
        for at, (low, _) in enumerate(bounds):
            edge = np.where(np.arange(len(theta)) == at, 0.0, theta)
            if low is not None and self._profiled(edge) <= self._profiled(theta) + FLAT:
                theta = edge
        return theta

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
    def covariance(self) -> FloatArray:
        """Covariance of people's intercepts and slopes."""
        factor = self._factor(self._theta) * self.sigma / self._z_scale[:, None]
        return np.asarray(factor @ factor.T)

    @property
    def boundary(self) -> bool:
        """Whether some combination of intercept and slope has no variance over people."""
        factor = self._factor(self._theta)
        return bool(np.sqrt(np.linalg.eigvalsh(factor @ factor.T).clip(0.0)).min() < BOUNDARY)

    @property
    def estimates(self) -> FloatArray:
        """Estimates of the fixed terms."""
        own = self._solved(self._theta)[2] * self._y_scale + self._first
        return np.linalg.solve(self._back, own)

    def _variances(self, both: FloatArray) -> FloatArray:
        """Return the fixed terms' variances by the parameters of the deviance."""
        inverse = np.linalg.inv(self._back)
        spread = both[-1] ** 2 * np.linalg.inv(self._solved(both[:-1])[1])
        return np.asarray(np.einsum("ij,jk,ik->i", inverse, spread, inverse))

    @property
    def errors(self) -> FloatArray:
        """Standard errors of the fixed terms."""
        return np.asarray(np.sqrt(self._variances(self._both)) * self._y_scale)

    @property
    def _both(self) -> FloatArray:
        return np.array([*self._theta, self._sigma])

    @property
    def freedom(self) -> FloatArray:
        """Satterthwaite's degrees of freedom of the fixed terms."""
        values, vectors = np.linalg.eigh(_hessian(self._deviance, self._both))
        positive = values > BOUNDARY * values.max()
        chosen = vectors[:, positive]
        spread = 2.0 * (chosen / values[positive]) @ chosen.T
        slopes = _slopes(self._variances, self._both)
        variances = self._variances(self._both)
        return np.asarray(2.0 * variances**2 / np.einsum("ki,kl,li->i", slopes, spread, slopes))


STEP = 1e-4
"""Of parameters that are about 1, for derivatives; of larger ones, their share."""


def _slopes(of: Callable[[FloatArray], FloatArray], at: FloatArray) -> FloatArray:
    """Return the derivatives of a function by each parameter, one row each."""
    sizes = STEP * np.maximum(1.0, np.abs(at))
    return np.stack(
        [(of(at + step) - of(at - step)) / (2.0 * step.sum()) for step in np.diag(sizes)]
    )


def _hessian(of: Callable[[FloatArray], float], at: FloatArray) -> FloatArray:
    """Return the second derivatives of a function."""
    sizes = STEP * np.maximum(1.0, np.abs(at))
    steps = np.diag(sizes)
    made = np.array(
        [
            [
                (of(at + one + two) - of(at + one - two) - of(at - one + two) + of(at - one - two))
                for two in steps
            ]
            for one in steps
        ]
    )
    return made / (4.0 * np.outer(sizes, sizes))
