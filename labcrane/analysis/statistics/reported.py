"""Reported statistics: whether F, degrees of freedom, p and eta squared can belong together."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Reported:
    """An F test as printed; texts, because the number of printed digits matters.

    Attributes
    ----------
    f, df1, df2, p
        ``"2.43"``, ``"5.27"``, ``"184.33"``, ``".034"``.
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
    """Recompute p and partial eta squared of a printed F test, rounding allowed for."""
    from scipy.stats import f as distribution

    (f_low, f, f_high), (df1_low, a, df1_high), (df2_low, b, df2_high) = map(
        _printed, (test.f, test.df1, test.df2)
    )
    corners = [(x, y) for x in (df1_low, df1_high) for y in (df2_low, df2_high)]
    p_low = min(float(distribution.sf(f_high, x, y)) for x, y in corners)
    p_high = max(float(distribution.sf(f_low, x, y)) for x, y in corners)
    eta_low, eta_high = _eta2p(f_low, df1_low, df2_high), _eta2p(f_high, df1_high, df2_low)
    return Consistency(
        p=float(distribution.sf(f, a, b)),
        p_low=p_low,
        p_high=p_high,
        p_consistent=_overlap(test.p, p_low, p_high),
        eta2p=_eta2p(f, a, b),
        eta2p_low=eta_low,
        eta2p_high=eta_high,
        eta2p_consistent=not test.eta2p or _overlap(test.eta2p, eta_low, eta_high),
    )


def _printed(text: str) -> tuple[float, float, float]:
    """Return the smallest, the printed and the largest value that is printed so."""
    digits = len(text.partition(".")[2])
    half = 0.5 * 10.0**-digits
    return float(text) - half, float(text), float(text) + half


def _eta2p(f: float, df1: float, df2: float) -> float:
    return f * df1 / (f * df1 + df2)


def _overlap(text: str, low: float, high: float) -> bool:
    smallest, _, largest = _printed(text)
    return smallest <= high and low <= largest
