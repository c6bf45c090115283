"""Trends of a measure along the session, and what they depend on."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd


LEAST_EIGENVALUE = 1e-4
"""Of the correlation of random effects; below it one of them follows from the other."""

FIXED = ("sequence", "difficulty", "far_side")
"""Fixed terms of the mixed model; one that does not vary is left out."""

DESIGN = ("group", "phase")
"""Further ones where a study has them; groups may learn in another way too."""

TIMES = ("movement_time", "onset_to_rest", "circle_to_circle", "reaction_time", "movement_onset")
"""How long people take is above 0 and skewed to the right: its logarithm is modelled."""


@dataclass(frozen=True, slots=True)
class Trend:
    """The test of each participant's slope against zero.

    Attributes
    ----------
    measure, along
        What changes, over what.
    slope, slope_ci
        Mean of the participants' least-squares slopes, in the measure's unit per step, with its
        95 % confidence interval.
    t, df, p
        The two-sided t test.
    dz
        Effect size: mean slope over the slopes' standard deviation.
    n
        Participants.
    people
        Who they are.
    """

    measure: str
    along: str
    slope: float
    slope_ci: tuple[float, float]
    t: float
    df: float
    p: float
    dz: float
    n: int
    people: tuple[str, ...]


def linear_trend(movements: "pd.DataFrame", measure: str) -> Trend | None:
    """Test for a linear trend over the sequence; None with fewer than three slopes.

    An F test over all positions says that some differ; only this says in which direction.
    """
    from scipy.stats import ttest_1samp

    slopes, people = [], []
    for name, own in movements.groupby("participant"):
        means = own.groupby("sequence")[measure].mean().dropna()
        if len(means) > 1:
            slopes.append(float(np.polyfit(means.index.to_numpy(float), means.to_numpy(), 1)[0]))
            people.append(str(name))
    if len(slopes) < 3 or np.ptp(slopes) == 0.0:  # noqa: PLR2004 - no test with fewer
        return None
    found = ttest_1samp(slopes, 0.0)
    low, high = found.confidence_interval(0.95)
    return Trend(
        measure,
        "sequence",
        slope=float(np.mean(slopes)),
        slope_ci=(float(low), float(high)),
        t=float(found.statistic),
        df=float(found.df),
        p=float(found.pvalue),
        dz=float(np.mean(slopes) / np.std(slopes, ddof=1)),
        n=len(slopes),
        people=tuple(people),
    )


def holm(p: Sequence[float]) -> list[float]:
    """Return p-values corrected after Holm (1979); a NaN is no test and does not count as one.

    The smallest is taken as often as there are tests, the next as often as are left, and none is
    below the one before it.
    """
    # statsmodels' multipletests collects all garbage in every call, a fifth of a second.
    corrected, largest = list(p), 0.0
    tested = sorted((value, at) for at, value in enumerate(p) if not math.isnan(value))
    for number, (value, at) in enumerate(tested):
        largest = max(largest, min(1.0, value * (len(tested) - number)))
        corrected[at] = largest
    return corrected


@dataclass(frozen=True, slots=True)
class MixedModel:
    """A linear mixed model of a measure, or of its logarithm.

    ``measure ~ sequence + difficulty + far_side + (1 + sequence | participant)``, sequence
    and difficulty centred; with groups also ``group * sequence``, with sessions or blocks
    ``phase``, with both ``group * phase`` where each group has each phase.

    Attributes
    ----------
    measure
        What was modelled.
    log
        Whether its logarithm was: of :data:`TIMES`, unless a value is 0 or less. Other measures are
        modelled as they are, since they have a sign, or a value of 0 that means something.
    terms
        One row per fixed term: term, estimate, standard error, z, p.
    participant_sd
        Standard deviation over participants of the intercept, of the logarithm if ``log``.
    residual_sd
        That of what is left.
    slopes
        Whether each participant has a slope of their own; without, the data could not carry it.
    converged
        Whether the fit came to its end; estimates of one that did not mean nothing.
    n, participants
        Movements and participants.
    missing
        Movements without a value, which are left out.
    """

    measure: str
    log: bool
    terms: "pd.DataFrame"
    participant_sd: float
    residual_sd: float
    slopes: bool
    converged: bool
    n: int
    participants: int
    missing: int


def mixed_model(movements: "pd.DataFrame", measure: str) -> MixedModel | None:
    """Fit the mixed model by REML; None with fewer than three participants.

    Participants with missing movements stay in. When the model with slopes for each participant
    does not converge, or has no variance left for them, the one without is fitted, and ``slopes``
    says so.
    """
    import pandas as pd

    data, log = _modelled(movements, measure)
    if data["participant"].nunique() < 3:  # noqa: PLR2004
        return None
    varied = [name for name in (*FIXED, *DESIGN) if name in data and data[name].nunique() > 1]
    if {"group", "sequence"} <= set(varied):
        varied.append("group:sequence")
    if {*DESIGN} <= set(varied) and pd.crosstab(data["group"], data["phase"]).to_numpy().all():
        varied.append("group:phase")
    formula = "y ~ " + (" + ".join(varied) or "1")
    for slopes in (True, False):
        found = _fit(formula, data, "~sequence" if slopes else "1")
        if found is not None:
            break
    else:
        return None
    terms = pd.DataFrame(
        {
            "term": found.fe_params.index,
            "estimate": found.fe_params.to_numpy(),
            "se": found.bse_fe.to_numpy(),
            "z": found.tvalues[found.fe_params.index].to_numpy(),
            "p": found.pvalues[found.fe_params.index].to_numpy(),
        }
    )
    return MixedModel(
        measure,
        log,
        terms,
        participant_sd=float(np.sqrt(found.cov_re.iloc[0, 0])),
        residual_sd=float(np.sqrt(found.scale)),
        slopes=slopes,
        converged=bool(found.converged),
        n=len(data),
        participants=data["participant"].nunique(),
        missing=len(movements) - len(data),
    )


def _modelled(movements: "pd.DataFrame", measure: str) -> tuple["pd.DataFrame", bool]:
    """Return what the model is fitted to, terms centred, and whether it is of the logarithm."""
    names = [*FIXED, *(name for name in DESIGN if name in movements), "participant"]
    table = movements[[measure, *names]].dropna()
    log = measure in TIMES and bool((table[measure] > 0.0).all())
    data = table[names].assign(y=np.log(table[measure]) if log else table[measure])
    for name in ("sequence", "difficulty"):
        data[name] -= data[name].mean()
    return data, log


def _fit(formula: str, data: "pd.DataFrame", random: str) -> Any:
    """Return the fitted model; None when it did not converge, or ended at a degenerate one."""
    import warnings

    from statsmodels.formula.api import mixedlm
    from statsmodels.tools.sm_exceptions import ConvergenceWarning, SingularMatrixWarning

    with warnings.catch_warnings():
        warnings.simplefilter("error", ConvergenceWarning)
        # statsmodels takes every small variance for a boundary, in whatever unit it is.
        warnings.filterwarnings("ignore", "The MLE may be on the boundary", ConvergenceWarning)
        # Of a step on the way; where the fit ends is looked at below.
        warnings.simplefilter("ignore", SingularMatrixWarning)
        try:
            found = mixedlm(formula, data, groups="participant", re_formula=random).fit(reml=True)
        except (ConvergenceWarning, np.linalg.LinAlgError):
            return None
    return None if _degenerate(found.cov_re.to_numpy(float)) else found


def _degenerate(covariance: FloatArray) -> bool:
    """Say whether a random effect has no variance of its own."""
    variances = np.diag(covariance)
    if variances.min() <= 0.0:
        return True
    spread = np.sqrt(variances)
    correlation = covariance / np.outer(spread, spread)
    return bool(np.linalg.eigvalsh(correlation).min() < LEAST_EIGENVALUE)
