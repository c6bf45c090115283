"""Sample size of a planned test: the smallest cohort that has a wanted power."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from labcrane.errors import ProtocolError
from labcrane.simulation.power import ALPHA, DIFFERENCE, Claim, Effect, Pool, Power, power

FEWEST = 4
MOST = 2000
"""Participants: the search ends here."""

FARTHEST = 4
"""How many times the cohort that is needed is looked at for the far end of its interval."""


@dataclass(frozen=True, slots=True)
class SampleSize:
    """How many participants a power needs.

    Attributes
    ----------
    goal
        The wanted power.
    participants
        The smallest cohort whose power is the goal or more.
    low, high
        The smallest cohorts at which the upper and the lower end of the power's 95 % interval are:
        what a larger pool and more cohorts could move it to. None where the lower end is below it
        even in cohorts :data:`FARTHEST` times as large.
    found
        The power with as many.
    """

    goal: float
    participants: int
    low: int
    high: int | None
    found: Power


def sample_size(
    pool: Pool, effect: Effect, goal: float, cohorts: int, seed: int, claim: Claim = DIFFERENCE
) -> SampleSize:
    """Return the smallest cohort with a power of ``goal``, of participants drawn from a pool.

    Raises
    ------
    ProtocolError
        Not even :data:`MOST` participants reach it, or it is not a power.
    """

    def at(size: int) -> Power:
        # Seeded by the size, so that a size always has the same power.
        (found,) = power(pool, effect, [size], cohorts, seed + size, claim=claim)
        return found

    return smallest_cohort(at, goal)


def smallest_cohort(power_of: Callable[[int], Power], goal: float) -> SampleSize:
    """Return the smallest cohort with a power of ``goal``, by halving; power grows with its size.

    Parameters
    ----------
    power_of
        The power of a cohort of a size.

    Raises
    ------
    ProtocolError
        Not even :data:`MOST` participants reach it, or it is not a power.
    """
    if not ALPHA < goal < 1.0:
        raise ProtocolError(f"a power of {goal:g} cannot be aimed at; write 0.8 or 0.9")
    known: dict[int, Power] = {}

    def at(size: int) -> Power:
        if size not in known:
            known[size] = power_of(size)
        return known[size]

    def smallest(end: str, most: int) -> int | None:
        enough = FEWEST
        while getattr(at(enough), end) < goal:
            if enough >= most:
                return None
            enough = min(2 * enough, most)
        too_few = enough // 2 if enough > FEWEST else FEWEST - 1
        while enough - too_few > 1:
            middle = (enough + too_few) // 2
            enough, too_few = (
                (middle, too_few) if getattr(at(middle), end) >= goal else (enough, middle)
            )
        return enough

    found = smallest("power", MOST)
    if found is None:
        raise ProtocolError(
            f"{MOST} participants have a power of {at(MOST).power:.2f}, below {goal:g}: "
            "the effect is too small for any study; look at --effect, or at the population"
        )
    low, high = smallest("power_high", found), smallest("power_low", FARTHEST * found)
    return SampleSize(goal, found, min(low or found, found), high and max(high, found), at(found))


def far_end(size: SampleSize) -> str:
    """Return the upper end of the interval of a size, in words."""
    return f"more than {FARTHEST * size.participants}" if size.high is None else f"{size.high}"


def paragraph(
    effect: str,
    claim: Claim,
    pool: int,
    sizes: Iterable[SampleSize],
    *,
    test: str = "",
    recorded: bool = False,
) -> str:
    """Return the paragraph on the number of participants for an application to an ethics board.

    Parameters
    ----------
    test
        Name of the test; empty for a t test of participants' means.
    recorded
        Whether the participants who are drawn were recorded, and not simulated.
    """
    shown = {
        "difference": f"an effect (two-sided test at {100 * ALPHA:g} %)",
        "equivalence": f"equivalence within a margin of {claim.margin:g} (two one-sided tests at "
        f"{100 * ALPHA:g} % each)",
        "non_inferiority": f"non-inferiority with a margin of {claim.margin:g} (one-sided test at "
        f"{100 * ALPHA:g} %)",
    }[claim.kind]
    who = (
        f"From {pool} participants of a pilot cohorts of each size were drawn with replacement"
        if recorded
        else f"The number of participants was planned by simulation. {pool} participants were "
        "simulated with the study's own protocol, and cohorts of each size were drawn from them"
    )
    by = f" by the report's {test}" if test else ""
    sentences = [f"{who}; in each, {effect} was tested as it is planned{by}, to show {shown}."]
    for each in sizes:
        found = each.found
        sentences.append(
            f"For a power of {100 * each.goal:g} %, {each.participants} participants are needed "
            f"({each.low} to {far_end(each)} by the 95 % interval, which is of {found.cohorts} "
            f"cohorts and of the {pool} participants they were drawn from; with "
            f"{each.participants} the power is {100 * found.power:.1f} %, 95 % interval "
            f"{100 * found.power_low:.1f} to {100 * found.power_high:.1f} %)."
        )
        if found.type_m == found.type_m:
            sentences.append(
                f"An effect that is found is then overstated by a factor of {found.type_m:.2f} on "
                f"average, and has the wrong sign in {100 * found.type_s:.1f} % of cases."
            )
    sentences.append("Participants are counted when they begin; those who drop out are included.")
    sentences.append(
        "A pilot is small, so these numbers include its own sampling error."
        if recorded
        else "The simulated operators are a model; the numbers hold for people only as far as the "
        "model does."
    )
    return " ".join(sentences)
