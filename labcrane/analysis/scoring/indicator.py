"""The performance indicator of the plug-in simulator.

Typiak 2024 names the components, their weights and the completion factor; the equation itself is
not in the text that is left of it and was reconstructed (docs/indicator.md)::

    PI = k (w_t f + sum of w_i g(n_i) + w_A s_A + w_SA s_SA)
    f = t_ref / t, at most 1        g(n) = max(0, 1 - n / 4)        s in [0, 1]
"""

from collections.abc import Mapping
from dataclasses import dataclass

from labcrane.analysis.scoring.settings import IndicatorSettings
from labcrane.errors import LabcraneError

FORMULA = "typiak-2024-reconstruction-1"
"""Version of the formula, stored with every result."""

OBJECTIVE = ("duration", "object", "body", "overload_max", "overload_min")
SUBJECTIVE = ("accuracy", "awareness")


@dataclass(frozen=True, slots=True)
class Performance:
    """What one test is judged by.

    Attributes
    ----------
    duration_s
        How long it took, in seconds.
    object, body, overload_max, overload_min
        Counts: collisions above the largest force with objects and with a body, overloads in each
        direction.
    accuracy, awareness
        Subjective ratings as shares, 0 to 1; NaN when the operator gave none.
    completed
        The completion factor k.
    drop
        How often something fell: reported beside the indicator, which has no part for it.
    """

    duration_s: float
    object: int
    body: int
    overload_max: int
    overload_min: int
    accuracy: float
    awareness: float
    completed: bool
    drop: int = 0


@dataclass(frozen=True, slots=True)
class Indicator:
    """Points of one test.

    Attributes
    ----------
    points
        Points of each component before the completion factor, by its name. NaN for a rating that
        is missing, and so are the sums it is part of: nothing is made up.
    largest
        Most points of each component.
    completed
        The completion factor k.
    """

    points: Mapping[str, float]
    largest: Mapping[str, float]
    completed: bool

    @property
    def raw(self) -> float:
        """The indicator in points: 0 for a test that was not completed, whatever is missing."""
        return sum(self.points.values()) if self.completed else 0.0

    @property
    def percent(self) -> float:
        """The indicator as a percentage of all points."""
        return 100.0 * self.raw / sum(self.largest.values())

    @property
    def objective(self) -> float:
        """Points of what was measured, before the completion factor."""
        return sum(points for name, points in self.points.items() if name in OBJECTIVE)

    @property
    def subjective(self) -> float:
        """Points of what the operator felt, before the completion factor."""
        return sum(points for name, points in self.points.items() if name in SUBJECTIVE)


def indicate(test: Performance, reference_s: float, settings: IndicatorSettings) -> Indicator:
    """Return the indicator of a test, against the operator's own reference time in seconds.

    Raises
    ------
    LabcraneError
        A time is not above 0, a count is below 0, or a rating outside 0 to 1.
    """
    _check(test, reference_s)
    share = reference_s / test.duration_s
    shares = {
        "duration": min(1.0, share) if settings.capped else share,
        "object": _left(test.object, settings.mistakes),
        "body": _left(test.body, settings.mistakes),
        "overload_max": _left(test.overload_max, settings.mistakes),
        "overload_min": _left(test.overload_min, settings.mistakes),
        "accuracy": test.accuracy,
        "awareness": test.awareness,
    }
    if settings.reading == "shared_overloads":
        both = test.overload_max + test.overload_min
        shares["overload_max"] = _left(both, settings.mistakes)
        del shares["overload_min"]
    largest = {name: float(getattr(settings.weights, name)) for name in shares}
    if not any(largest.values()):
        raise LabcraneError(
            "all weights that count in this reading are 0; at least one must be above 0"
        )
    points = {name: largest[name] * value for name, value in shares.items()}
    return Indicator(points, largest, test.completed)


def _left(mistakes: int, limit: int) -> float:
    """Return what is left of a component: 1 without mistakes, 0 at the limit and beyond."""
    return max(0.0, 1.0 - mistakes / limit)


def _check(test: Performance, reference_s: float) -> None:
    for what, value in (("test", test.duration_s), ("reference", reference_s)):
        if not value > 0.0:
            raise LabcraneError(f"the {what} took {value} s; it must be more than 0 s")
    for name in OBJECTIVE[1:]:
        if getattr(test, name) < 0:
            raise LabcraneError(f"{name} counts {getattr(test, name)}; it must be 0 or more")
    for name in SUBJECTIVE:
        if not 0.0 <= getattr(test, name) <= 1.0 and getattr(test, name) == getattr(test, name):
            raise LabcraneError(f"{name} is {getattr(test, name)}; it must be 0 to 1")
