"""Outcomes of a study in its design: planned tests, contrasts, time scales, questionnaires."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from labcrane.analysis.presented import not_presented
from labcrane.analysis.quality import is_success
from labcrane.analysis.report.factors import (
    BLOCK,
    CONDITION,
    DISTANCE,
    GROUP,
    PHASE,
    PLACE,
    SESSION,
    SIDE,
    Factors,
)
from labcrane.analysis.statistics.anova import (
    Anova,
    Contrast,
    FactorialDesign,
    compare,
    design,
    effects_in,
)
from labcrane.analysis.statistics.confounding import told_apart
from labcrane.analysis.statistics.time_scales import (
    FROM_BEFORE,
    TAKEN,
)
from labcrane.analysis.statistics.trends import Trend

if TYPE_CHECKING:
    import pandas as pd

USUAL = ("movement_time", "absolute_error", "circle_to_circle")
"""Measures tested in every study that recorded them, with the protocol's primary outcomes."""

TO_REST = "onset_to_rest"
"""Tested too if movements do not end by rest, so that it differs from movement time."""

ADJUSTED = f" with {TAKEN}"
"""Suffix of an effect of positions that was adjusted for pairs of targets."""

OCCASION = "occasion"
PRACTICE = "practice"

Confusable = tuple[tuple[str, tuple[str, ...]], ...]
"""Possible confounds of an effect: each in words, with its columns."""

PAIRS = "pairs of targets"
ORDER = "the order in which conditions came"
POSITIONS: Confusable = (("positions", (PHASE, PLACE)),)
"""Positions hold learning, and pairs their distance."""

BESIDE_PHASES: Confusable = (
    ("conditions", (CONDITION,)),
    ("feedback", ("feedback",)),
    ("the targets' distance", (DISTANCE,)),
    ("the targets' width", ("width",)),
)
"""What may change between sessions or blocks for all participants, in addition to learning."""

Test = Anova | Contrast | Trend | Mapping[str, Any]
"""A test, or the row of a quantity of the time scales."""

OF_PHASES = {PHASE, SESSION, BLOCK, CONDITION, OCCASION}


@dataclass(frozen=True, slots=True)
class Plan:
    """A planned analysis of variance, and its requested effects.

    Attributes
    ----------
    within
        Columns of the factors within participants.
    asked
        Columns that a requested effect must include; without any, every effect is requested.
    beside
        Column that identifies pairs, where the effect is adjusted for them; otherwise empty.
    period
        Column of what comes with the order of conditions, taken out where it can be told from them.
    phase
        The only phase whose movements are in it; empty for all.
    confusable
        Possible confounds of the effects.
    """

    within: tuple[str, ...]
    asked: tuple[str, ...] = ()
    beside: str = ""
    phase: str = ""
    confusable: Confusable = ()
    period: str = ""

    @property
    def suffix(self) -> str:
        """Suffix of an effect's name: its phase and adjustment."""
        return f" in {self.phase}" * bool(self.phase) + ADJUSTED * bool(self.beside)

    @property
    def effects(self) -> list[tuple[str, ...]]:
        """Columns of the effects it is made for; interactions come with those of one factor."""
        return [self.asked] if self.asked else [(name,) for name in (*self.within, GROUP)]

    def of(self, results: "pd.DataFrame") -> "pd.DataFrame":
        """Return its movements."""
        if CONDITION in self.within:  # blocks beside them are of none
            results = results[results[CONDITION].fillna("") != ""]
        return results[results[PHASE] == self.phase] if self.phase else results

    def cells(
        self, results: "pd.DataFrame", measure: str, between: Sequence[str]
    ) -> FactorialDesign:
        """Return the participants' means of a measure in its cells."""
        return design(self.of(results), measure, self.within, between, self.beside, self.period)

    def tests(self, cells: FactorialDesign, measure: str) -> Iterator[Anova]:
        """Yield the requested tests; one that was to be adjusted for pairs and was not is left out.

        Conditions that cannot be told from their period are tested with it.
        """
        found = [
            test
            for test in effects_in(cells, measure, self.beside or self.period)
            if set(self.asked) <= set(test.factor.split(":"))
            and (self.period or test.beside == self.beside)
        ]
        if self.period and not found and cells.beside.shape[2]:
            yield from self.tests(replace(cells, beside=cells.beside[:, :, :0]), measure)
        yield from found


def confounds(
    rows: "pd.DataFrame",
    measure: str,
    people: Collection[str],
    effect: Sequence[str],
    confusable: Confusable,
) -> str:
    """Return what an effect cannot be distinguished from in those who are in its test.

    Parameters
    ----------
    people
        Who is in the test: the orders of others could remove the confound.
    effect
        Its columns.
    """
    known = rows.dropna(subset=[measure])
    known = known[known["participant"].isin(people)]
    # A session, block or condition is all of a participant's phase: it is told from what comes
    # with it over participants.
    person = ("participant",) if set(effect) <= OF_PHASES else ("participant", PHASE)
    found = [
        words
        for words, columns in confusable
        if set(columns) <= set(known)
        and not set(columns) & set(effect)
        and not told_apart(known, effect, [person, columns])
    ]
    return " and ".join(found)


CONDITIONS = Plan((CONDITION,), (CONDITION,), period=PHASE)
"""Conditions within participants, over the means of all their blocks, with the period taken out."""

SCORE_OCCASIONS = Plan((OCCASION,), confusable=(("conditions", (CONDITION,)),))
SCORE_CONDITIONS = Plan((CONDITION,), (CONDITION,), period=OCCASION)
"""Scores of questionnaires, over when they were asked, and over the conditions before."""


@dataclass(frozen=True, slots=True)
class StudyMovements:
    """Movements of a study with their factors, which its tests are of.

    Attributes
    ----------
    results
        Those that are results.
    recorded
        All that count, to tell what failed from what was never recorded.
    factors
        Factors of the study, with all participants of the sample.
    primary
        Outcomes that the protocol names as primary.
    """

    results: "pd.DataFrame"
    recorded: "pd.DataFrame"
    factors: Factors
    primary: Sequence[str] = ()

    @property
    def measures(self) -> list[str]:
        """The recorded outcomes, the primary ones first."""
        return measures_in(self.results, self.primary)


def measures_in(results: "pd.DataFrame", primary: Sequence[str] = ()) -> list[str]:
    """Return the recorded outcomes, the primary ones first."""
    names = dict.fromkeys([*primary, *USUAL, *([TO_REST] if rests_apart(results) else [])])
    return [name for name in names if name in results and results[name].notna().any()]


def rests_apart(results: "pd.DataFrame") -> bool:
    """Return whether movements do not end by rest, so that rest has a time of its own."""
    if not {TO_REST, "movement_time"} <= set(results):
        return False
    apart = results["movement_time"].notna() & (results[TO_REST] != results["movement_time"])
    return bool(apart.any())


def plans(results: "pd.DataFrame", factors: Factors) -> Iterator[Plan]:
    """Yield the plans of every outcome."""
    phases = tuple(factors.over_phases)
    pair = pair_of(results)
    confusable = of_pairs(results)
    # First, because most participants are whole there.
    yield Plan(phases, confusable=BESIDE_PHASES)
    if factors.conditions:
        yield CONDITIONS
    # Positions of phases of unequal length have nothing to do with each other.
    for phase in ("",) if factors.alike else factors.phases:
        within = (PLACE,) if phase else (*phases, PLACE)
        yield Plan(within, (PLACE,), phase=phase, confusable=confusable)
        if pair and results[pair].nunique() > 1:
            yield Plan(within, (PLACE,), pair, phase, confusable)
    for name in (DISTANCE, SIDE):
        if name in results:
            yield Plan((*phases, name), (name,), confusable=POSITIONS)
    if {DISTANCE, SIDE} <= set(results):  # a pair of targets is a distance on a side
        yield Plan((DISTANCE, SIDE), (DISTANCE, SIDE), confusable=POSITIONS)


def pair_of(results: "pd.DataFrame") -> str:
    """Return the column that identifies pairs of targets; empty if there is none."""
    return next((name for name in ("pair", DISTANCE) if name in results), "")


def of_pairs(results: "pd.DataFrame") -> Confusable:
    """Return the possible confounds of positions: pairs of targets, where there are any."""
    pair = pair_of(results)
    return ((PAIRS, (pair,)),) if pair else ()


def tests(results: "pd.DataFrame", measure: str, factors: Factors) -> Iterator[Anova]:
    """Yield the tests of an outcome, with their effects named as in the tables."""
    for plan in plans(results, factors):
        for test in plan.tests(plan.cells(results, measure, factors.between), measure):
            yield replace(test, factor=factors.named(test.factor + plan.suffix))


def practised(everything: "pd.DataFrame") -> "pd.DataFrame":
    """Return successful, shown movements including practice, with practice as a factor."""
    done = everything[is_success(everything) & ~not_presented(everything)].copy()
    return done.assign(practice=practice_words(done))


def practice_words(movements: "pd.DataFrame") -> "pd.Series[str]":
    """Return whether movements are practice or counted, in words."""
    return movements["practice"].astype(float).map({0.0: "counted", 1.0: "practice"})


def contrasts(study: StudyMovements) -> list[Contrast]:
    """Return differences of groups, of phases, and of groups in each phase, after Holm."""
    results, factors = study.results, study.factors
    between, phases = factors.between, factors.over_phases
    found: list[Contrast] = []
    for measure in study.measures:
        found += compare(results, measure, GROUP, phases, between)
        for name in phases:
            of_phases = compare(results, measure, name, phases, between)
            found += compare(results, measure, GROUP, phases, between, at=name)
            for other in phases:
                if other != name:
                    of_phases += compare(results, measure, name, phases, between, at=other)
            for one in of_phases:
                two = results[results[name].isin([one.first, one.second])]
                confounded = confounds(two, measure, one.people, (name,), BESIDE_PHASES)
                found.append(replace(one, confounded=confounded))
        for one in compare(results, measure, DISTANCE, (*phases, DISTANCE), between):
            confounded = confounds(results, measure, one.people, (DISTANCE,), POSITIONS)
            found.append(replace(one, confounded=confounded))
        if factors.conditions:
            own = CONDITIONS.of(results)
            asked = compare(own, measure, CONDITION, (CONDITION,), between, period=PHASE)
            found += [replace(one, confounded="" if one.beside else ORDER) for one in asked]
    return [replace(one, factor=factors.named(one.factor)) for one in found]


def between_phases(
    results: "pd.DataFrame", row: Mapping[str, Any], found: "pd.DataFrame", factors: Factors
) -> str:
    """Return the confounds of a quantity that goes from one phase to the next; empty if none.

    Parameters
    ----------
    row
        The quantity's row in the table of the time scales.
    found
        The quantity of each participant.
    """
    at = factors.phases.index(str(row["phase"]))
    if row["quantity"] not in FROM_BEFORE or not at:
        return ""
    own = found[(found["phase"] == row["phase"]) & (found["quantity"] == row["quantity"])]
    if row["group"] != "all":
        own = own[own["group"] == row["group"]]
    two = results[results[PHASE].isin(factors.phases[at - 1 : at + 1])]
    people = set(own["participant"])
    return confounds(two, str(row["measure"]), people, (PHASE,), BESIDE_PHASES)


def score_table(
    scores: "pd.DataFrame", groups: dict[str, str], over: str = OCCASION
) -> "pd.DataFrame":
    """Return means and spreads of every score, by group and occasion, or condition before it.

    Values of the tested participants, who have one at every level, are next to those of all.
    """
    import pandas as pd

    own = occasions(scores, groups).dropna(subset=["value"])
    if over == CONDITION:
        own = after_conditions(own)
    if own.empty:
        return pd.DataFrame()
    by = ["outcome", GROUP, over]
    each = own.groupby([*by, "participant"])["value"].mean()
    had = each.groupby(level=["outcome", "participant"]).transform("size")
    planned = own.groupby("outcome")[over].nunique().loc[each.index.get_level_values(0)]
    whole = each[had.to_numpy() == planned.to_numpy()]
    table = pd.DataFrame(
        {
            name + suffix: getattr(part.groupby(level=by), of)()
            for suffix, part in (("", each), ("_tested", whole))
            for name, of in (("n", "count"), ("mean", "mean"), ("sd", "std"))
        }
    )
    return table.fillna({"n_tested": 0}).astype({"n_tested": int}).reset_index()


def with_conditions(scores: "pd.DataFrame", movements: "pd.DataFrame") -> "pd.DataFrame":
    """Return scores with the condition of the block that each was asked after; "" for none.

    Parameters
    ----------
    movements
        Of the same people, with ``condition`` where they had several.
    """
    where = ["participant", "session", "block"]
    if CONDITION not in movements or not len(scores):
        return scores.assign(condition="")
    blocks = movements.drop_duplicates(where).set_index(where)[CONDITION].fillna("")
    keys = zip(*(scores[name] for name in where), strict=True)
    return scores.assign(condition=[blocks.get(key, "") for key in keys])


def after_conditions(scores: "pd.DataFrame") -> "pd.DataFrame":
    """Return the scores of questionnaires that were asked after blocks of several conditions.

    Of one that was asked several times after a block, the first counts: the last may be about the
    whole session.
    """
    if CONDITION not in scores:
        return scores.iloc[:0].assign(condition="")
    own = scores[scores[CONDITION] != ""]
    first = own.groupby(["participant", "session", "block", "outcome"])["step"].transform("min")
    own = own[own["step"] == first]
    each = own.groupby(["outcome", "participant"])[CONDITION].nunique()
    return own[own["outcome"].map(each.groupby(level=0).max()) > 1]


def occasions(scores: "pd.DataFrame", groups: dict[str, str]) -> "pd.DataFrame":
    """Return scores with their outcome, group and occasion."""
    own = scores.copy()
    own[GROUP] = own["participant"].map(groups).fillna("")
    own["outcome"] = own["questionnaire"] + " " + own["score"]
    own["occasion"] = [
        f"session {session:g}, step {step:g}"
        for session, step in zip(own["session"], own["step"], strict=True)
    ]
    return own


GAZE_VALID = ("gaze_valid_before", "gaze_valid_during")
"""Columns of the shares of time in which the gaze position is known."""

HALF = 0.5
"""Share of the time below which the report warns of dwell: what is not known counts as no look."""


def little_gaze(results: "pd.DataFrame") -> int:
    """Return in how many movements gaze is not known for half of the time before or during them."""
    shares = results[[name for name in GAZE_VALID if name in results]]
    return int((shares < HALF).any(axis=1).sum())


def gaze_table(results: "pd.DataFrame", factors: Factors) -> "pd.DataFrame":
    """Return means over participants' means of how long areas were looked at, and of how many.

    With the share of the time in which the gaze position is known.
    """
    import pandas as pd

    columns = of_gaze(results)
    if not columns:
        return pd.DataFrame()
    columns += [name for name in GAZE_VALID if name in results]
    by = [*factors.between, *factors.by_phase, DISTANCE]
    each = results.groupby([*by, "participant"])[columns].mean()
    cells = each.groupby(level=by)
    return cells.mean().join(cells.count().add_prefix("n_")).reset_index()


def of_gaze(results: "pd.DataFrame") -> list[str]:
    """Return the columns of gaze with values."""
    names = [str(name) for name in results if str(name).startswith(("dwell_", "look_lead_"))]
    return [name for name in names if results[name].notna().any()]


def row_of(test: Test, factors: Factors) -> dict[str, Any]:
    """Return a test as a row of its table, with the participants who are not in it."""
    if isinstance(test, Mapping):
        return dict(test)
    row: dict[str, Any] = asdict(test)
    people = set(row.pop("people"))
    row["left_out"] = " ".join(name for name in factors.people if name not in people)
    row.pop("beside", None)
    if isinstance(test, Trend):
        row[factors.kind] = row.pop("phase")
        row["slope_low"], row["slope_high"] = row.pop("slope_ci")
    return row
