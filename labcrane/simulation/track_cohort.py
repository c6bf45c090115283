"""Thresholds of simulated people whose threshold is known: how well a track finds them."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from labcrane.core.records import PlannedTrial
from labcrane.design.seeds import derive
from labcrane.design.tracks import PlannedTrack, standing
from labcrane.design.up_down import settles_at
from labcrane.errors import ProtocolError
from labcrane.protocol.tracks import Track

if TYPE_CHECKING:
    import pandas as pd

OPERATORS = 1000
"""By whom a recorded track is judged."""

STEEPNESS = (0.5, 1.0, 2.0)
"""Spreads with which a staircase, which has none of its own, is tested: in mean steps of its
levels."""

LEAST = 20
"""Fewest operators from whom bias and spread are reported."""

END = 0.1
"""Share of the operators at either end, whose bias is reported separately: a mean over all hides
that thresholds near the easiest or the hardest level are estimated too far from the end."""


@dataclass(frozen=True, slots=True)
class Ability:
    """Probability of success of an operator, as in :class:`labcrane.protocol.tracks.QuestPlus`.

    Attributes
    ----------
    threshold, spread
        In the levels' unit.
    guess, lapse
        Probability of success by chance, and of failure however easy it is.
    """

    threshold: float
    spread: float
    guess: float = 0.0
    lapse: float = 0.0

    def success(self, level: float) -> float:
        """Return the probability of a success at a level."""
        from scipy.special import ndtr

        able = float(ndtr((self.threshold - level) / self.spread))
        return self.guess + (1.0 - self.guess - self.lapse) * able

    def level_of(self, success: float) -> float:
        """Return the level at which a success has this probability."""
        from scipy.special import ndtri

        able = (success - self.guess) / (1.0 - self.guess - self.lapse)
        return self.threshold - self.spread * float(ndtri(able))


@dataclass(frozen=True, slots=True)
class TrackQuality:
    """How well a track finds thresholds, in the levels' unit.

    Attributes
    ----------
    track, by
        Which, and what chooses its levels.
    operators, without
        How many there were, and for how many there is no estimate.
    bias, bias_low, bias_high
        Mean of estimate minus truth, with its 95 % confidence interval.
    spread
        Standard deviation of estimate minus truth.
    bias_in_sd
        Bias as a share of the spread.
    bias_lowest, bias_highest
        The same mean of the tenth of the operators with the lowest thresholds, and the highest.
    trials
        Counted trials of a block on average.
    ended
        Share of the blocks that came to an end before all rounds were done.
    """

    track: str
    by: str
    operators: int
    without: int
    bias: float
    bias_low: float
    bias_high: float
    spread: float
    bias_in_sd: float
    bias_lowest: float
    bias_highest: float
    trials: float
    ended: float


def abilities(
    track: PlannedTrack, operators: int, spreads: Sequence[float], seed: int
) -> list[Ability]:
    """Draw people: thresholds evenly from the easiest to the hardest level, a spread of the given.

    Chance and lapses are those that QUEST+ believes in; with a staircase there are none.

    Parameters
    ----------
    spreads
        For a staircase; empty for QUEST+, which has its own.
    """
    law = track.settings.quest_plus
    spreads = spreads or (law.spreads if law is not None else ())
    random = np.random.default_rng(seed)
    numbers = list(track.settings.levels.values())
    thresholds = random.uniform(min(numbers), max(numbers), operators).tolist()
    steepness = random.choice(np.asarray(spreads, float), operators).tolist()
    chance = (0.0, 0.0) if law is None else (law.guess, law.lapse)
    return [Ability(*each, *chance) for each in zip(thresholds, steepness, strict=True)]


def observe(track: PlannedTrack, people: Sequence[Ability], seed: int) -> "pd.DataFrame":
    """Lead all operators through a block; return a row each.

    Columns are ``threshold`` and ``spread`` as they were drawn, ``truth``, what the track is after,
    ``estimate``, ``sd``, ``trials`` and whether it ``ended`` before all rounds were done.
    """
    import pandas as pd

    random, settings = np.random.default_rng(seed), track.settings
    up_down = settings.up_down
    sought = None if up_down is None else settles_at(up_down)
    rows = []
    for person in people:
        told: list[tuple[str, bool]] = []
        where = standing(settings)
        for _ in range(settings.rounds):
            if where.level is None:
                break
            chance = person.success(settings.levels[where.level])
            told += [
                (where.level, bool(hit)) for hit in random.uniform(size=track.counted) < chance
            ]
            where = standing(settings, (), told)
        truth = person.threshold if sought is None else person.level_of(sought)
        rows.append(
            (person.threshold, person.spread, truth, where.estimate, where.sd, len(told),
             where.level is None)
        )  # fmt: skip
    columns = ["threshold", "spread", "truth", "estimate", "sd", "trials", "ended"]
    return pd.DataFrame(rows, columns=columns)


def quality(track: PlannedTrack, found: "pd.DataFrame") -> TrackQuality:
    """Return bias and spread of a track's estimates."""
    from scipy.stats import t

    known = found.dropna(subset=["estimate"]).sort_values("truth", kind="stable")
    errors = (known["estimate"] - known["truth"]).to_numpy(float)
    count = len(errors)
    if count < LEAST:
        raise ProtocolError(
            f"track {track.name!r} has an estimate of {count} of {len(found)} operators, and bias "
            f"needs {LEAST}; allow more rounds or fewer reversals"
        )
    bias, spread = float(errors.mean()), float(errors.std(ddof=1))
    reach = float(t.ppf(0.975, count - 1)) * spread / count**0.5
    end = int(count * END)
    return TrackQuality(
        track.name, track.settings.by, len(found), len(found) - count, bias, bias - reach,
        bias + reach, spread, bias / spread, float(errors[:end].mean()),
        float(errors[-end:].mean()), float(found["trials"].mean()), float(found["ended"].mean()),
    )  # fmt: skip


def judged(name: str, described: str) -> "pd.DataFrame":
    """Return how well a recorded track finds thresholds; a row for each spread of a staircase.

    Parameters
    ----------
    described
        Its description in a recording, :attr:`labcrane.design.tracks.PlannedTrack.described`, as
        JSON.
    """
    import pandas as pd

    about = json.loads(described)
    settings = Track.model_validate(about["settings"], context={"recorded": True})
    trial = PlannedTrial({}, expected_s=0.0)
    rounds = dict.fromkeys(settings.levels, (trial,) * int(about["counted"]))
    track = PlannedTrack(name, settings, 1, int(about["counted"]) * settings.rounds, rounds)
    numbers = sorted(settings.levels.values())
    step = (numbers[-1] - numbers[0]) / (len(numbers) - 1)
    believed = [()] if settings.quest_plus else [(share * step,) for share in STEEPNESS]
    seed = derive("tracks", name, described)
    rows = []
    for spreads in believed:
        people = observe(track, abilities(track, OPERATORS, spreads, seed), seed + 1)
        try:
            row = asdict(quality(track, people))
        except ProtocolError as error:
            row = {"track": name, "by": settings.by, "operators": OPERATORS, "why not": str(error)}
        rows.append({**row, "steepness": spreads[0] if spreads else "believed"})
    return pd.DataFrame(rows)
