"""Terms that an uncertainty is made of: what each may be off by, by name."""

from collections.abc import Mapping
from enum import StrEnum

import numpy as np

from labcrane.types import FloatArray

Terms = Mapping[str, FloatArray]
"""By name, by how much each sample's time may be off for that reason, in seconds, shape ``(n,)``.
The stated uncertainty is their sum, and nothing else: :func:`total`."""


class Term(StrEnum):
    """Why a corrected time may be off."""

    CLOCK = "clock"
    LAG = "lag"
    STAMPS = "stamps"
    LOSSES = "losses"
    SHIFTS = "shifts"


MEANS = {
    Term.CLOCK: "its clock's offset is known by probes and the curve through them, or by arrivals",
    Term.LAG: "its clock or its program may be late, or ahead, by as much as arrivals allow",
    Term.STAMPS: "its timestamps scatter about its samples, are cut, or stand still",
    Term.LOSSES: "which samples were lost is not known, or to which side of a step one belongs",
    Term.SHIFTS: "the delay before its timestamps, or its clock, changed",
}
"""What each says, in a sentence without its end."""


def none_of(count: int) -> dict[str, FloatArray]:
    """Return all terms of so many samples, each 0."""
    return {term: np.zeros(count) for term in Term}


def total(terms: Terms) -> FloatArray:
    """Return the uncertainty: the sum of its terms, shape ``(n,)``."""
    return np.asarray(np.sum(list(terms.values()), axis=0))


def typical(terms: Terms, time: FloatArray) -> tuple[float, dict[str, float]]:
    """Return the uncertainty that 95 % of samples with a time stay within, and what it is made of.

    It is that of one sample, so that its terms add up to it. NaN and empty where none is known.
    """
    error = total(terms)
    known = np.flatnonzero(np.isfinite(time) & np.isfinite(error))
    if not len(known):
        return np.nan, {}
    p95 = np.quantile(error[known], 0.95, method="higher")
    at = known[np.argmax(error[known] == p95)]
    return float(p95), {str(name): float(term[at]) for name, term in terms.items()}


def in_words(uncertainty_s: float, made_of: Mapping[str, float]) -> str:
    """Return an uncertainty and what it is made of, the largest first, down to 1 us."""
    if np.isnan(uncertainty_s):
        return "an unknown time"
    largest = sorted(made_of.items(), key=lambda one: -one[1])
    shown = " + ".join(f"{1e3 * size:.3f} {name}" for name, size in largest if size >= LEAST_S)
    return f"{1e3 * uncertainty_s:.3f} ms" + (f" ({shown})" if shown else "")


LEAST_S = 1e-6
