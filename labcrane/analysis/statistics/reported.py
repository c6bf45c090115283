"""Reported statistics: whether F, degrees of freedom, p and eta squared can belong together."""

import re
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Reported:
    """An F test as printed; texts, because the number of printed digits matters.

    Attributes
    ----------
    f, df1, df2, p
        ``"2.43"``, ``"5.27"``, ``"184.33"``, ``".034"`` or ``"< .001"``. Whole degrees of freedom
        are exact, others are rounded.
    eta2p
        Partial eta squared as printed, or "".
    """

    f: str
    df1: str
    df2: str
    p: str
    eta2p: str = ""


@dataclass(frozen=True, slots=True)
class Consistency:
    """The result of recomputing a printed test.

    Attributes
    ----------
    p
        From the printed F and degrees of freedom.
    p_low, p_high
        The smallest and the largest p that printed values could have been rounded from.
    p_consistent
        Whether the printed p is in this range.
    eta2p
        Partial eta squared from the printed values.
    eta2p_low, eta2p_high
        The same for it.
    eta2p_consistent
        Whether the printed one is; True where none was printed.
    """

    p: float
    p_low: float
    p_high: float
    p_consistent: bool
    eta2p: float
    eta2p_low: float
    eta2p_high: float
    eta2p_consistent: bool


def check_reported(test: Reported) -> Consistency:
    """Recompute p and partial eta squared of a printed F test, rounding allowed for.

    Raises
    ------
    ValueError
        A text is not a number; p may also be given as ``< .001``, ``> .05`` or ``p = .034``.
    """
    from scipy.stats import f as distribution

    sign, printed = _compared(test.p)
    (f_low, f, f_high), df1, df2 = _printed(test.f), _free(test.df1), _free(test.df2)
    # p falls with F; over degrees of freedom it may be largest inside their range.
    grid = np.meshgrid(np.linspace(*df1, STEPS), np.linspace(*df2, STEPS))
    p_low = float(distribution.sf(f_high, *grid).min())
    p_high = float(distribution.sf(f_low, *grid).max())
    eta_low, eta_high = _eta2p(f_low, df1[0], df2[1]), _eta2p(f_high, df1[1], df2[0])
    exact = {"<": p_low < float(printed), ">": p_high > float(printed)}
    a, b = float(test.df1), float(test.df2)
    return Consistency(
        p=float(distribution.sf(f, a, b)),
        p_low=p_low,
        p_high=p_high,
        p_consistent=exact[sign] if sign in exact else _overlap(printed, p_low, p_high),
        eta2p=_eta2p(f, a, b),
        eta2p_low=eta_low,
        eta2p_high=eta_high,
        eta2p_consistent=not test.eta2p or _overlap(test.eta2p, eta_low, eta_high),
    )


STEPS = 9
"""Steps over the range of a rounded degree of freedom."""

SLACK = 1e-9
"""Of the ends of a range: binary fractions cannot hold decimal ones."""


def _compared(text: str) -> tuple[str, str]:
    """Return the sign and the number of ``.034``, ``= .034``, ``< .001`` or ``p > .05``."""
    found = re.fullmatch(r"\s*p?\s*([<>=]?)\s*(\d*\.?\d+)\s*", text)
    if found is None:
        raise ValueError(f"p is {text!r}; give '.034', '= .034', '< .001' or '> .05'")
    return found[1], found[2]


def _free(text: str) -> tuple[float, float]:
    """Return the range of printed degrees of freedom; whole ones are exact."""
    low, value, high = _printed(text)
    return (low, high) if "." in text else (value, value)


def _printed(text: str) -> tuple[float, float, float]:
    """Return the smallest, the printed and the largest value that is printed so."""
    digits = len(text.partition(".")[2])
    half = 0.5 * 10.0**-digits
    return max(0.0, float(text) - half), float(text), float(text) + half


def _eta2p(f: float, df1: float, df2: float) -> float:
    return f * df1 / (f * df1 + df2)


def _overlap(text: str, low: float, high: float) -> bool:
    smallest, _, largest = _printed(text)
    return smallest <= high + SLACK and low - SLACK <= largest
