"""Findings of a study: what came of each planned effect, its test or why there is none."""

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from itertools import groupby, product
from typing import TYPE_CHECKING, Any

from labcrane.analysis.presented import not_presented
from labcrane.analysis.quality import is_success
from labcrane.analysis.report.factors import (
    DISTANCE,
    GROUP,
    PHASE,
    PLACE,
    SEQUENCE,
    Factors,
)
from labcrane.analysis.report.outcomes import (
    ADJUSTED,
    ORDER,
    PRACTICE,
    SCORE_CONDITIONS,
    SCORE_OCCASIONS,
    Plan,
    StudyMovements,
    Test,
    after_conditions,
    between_phases,
    confounds,
    contrasts,
    measures_in,
    occasions,
    of_gaze,
    of_pairs,
    plans,
    practice_words,
    practised,
    row_of,
)
from labcrane.analysis.statistics.anova import (
    Anova,
    FactorialDesign,
    analyse,
    word,
)
from labcrane.analysis.statistics.time_scales import FROM_BEFORE, adjusted, quantities, summary
from labcrane.analysis.statistics.trends import LEAST, Trend, holm, linear_trend
from labcrane.errors import shortened

if TYPE_CHECKING:
    import pandas as pd

NOTHING = "nothing recorded"

NAMED = 12
"""Participants or movements named one by one in a sentence; tables list all."""

SHOWN = 3
"""Cells without a value that are named; the others are only counted."""

NO_PLAN = Plan(())
"""Of trends and time scales, which are not analyses of variance."""

Cell = tuple[Any, ...]
"""The levels of a cell, one of each factor."""


@dataclass(frozen=True, slots=True)
class Shortfall:
    """What a planned test lacks.

    Attributes
    ----------
    without
        The group, level or people missing from the test; empty if there is no test.
    people
        Number in the sample, or in the missing group.
    whole
        Number of them with a value in every cell.
    why
        The reason in words.
    """

    without: str
    people: int
    whole: int
    why: str


@dataclass(frozen=True, slots=True)
class StudyFinding:
    """What came of one effect on one measure.

    Attributes
    ----------
    table
        The report's table of such tests.
    measure, effect
        The measure and the effect, as in that table.
    test
        The test with its confounds and its participants; None where it was not possible. Of a
        quantity of the time scales, its row in their table, which states why it is not tested.
    short
        Why there is no test, or what it is without. Empty of an interaction that comes with its
        factors: their findings state it.
    columns
        Columns of the effect of an analysis of variance.
    plan
        The analysis of variance that the effect is part of.
    cells
        The participants' means in its cells; None of other tests.
    """

    table: str
    measure: str
    effect: str
    test: Test | None
    short: tuple[Shortfall, ...] = ()
    columns: tuple[str, ...] = ()
    plan: Plan = NO_PLAN
    cells: FactorialDesign | None = None


@dataclass(frozen=True, slots=True)
class Results:
    """Results of a study, for tables and sentences.

    Attributes
    ----------
    sample
        The sample in a sentence.
    time_outs
        Counts by condition.
    factors
        Factors of the study, with all participants of the sample.
    findings
        Of every planned test.
    primary
        Outcomes that the protocol names as primary.
    units
        Of the measures, by name; "1" and "" are none.
    """

    sample: str
    time_outs: "pd.DataFrame"
    factors: Factors
    findings: Sequence[StudyFinding] = ()
    primary: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def people(self) -> int:
        """Participants of the sample; a test of fewer states its own number."""
        return len(self.factors.people)

    def tests(self, *tables: str) -> list[Anova]:
        """Return the analyses of variance in some of the report's tables."""
        found = [one.test for one in self.findings if one.table in tables]
        return [test for test in found if isinstance(test, Anova)]

    def measures(self, *tables: str) -> list[str]:
        """Return the measures whose tests were planned in some of the report's tables."""
        return list(dict.fromkeys(one.measure for one in self.findings if one.table in tables))

    def of(self, measure: str) -> list[StudyFinding]:
        """Return the findings of a measure."""
        return [one for one in self.findings if one.measure == measure]

    def in_positions(self, results: "pd.DataFrame", measure: str) -> "pd.DataFrame":
        """Return the movements of those who are in a test over positions; empty if none is."""
        import pandas as pd

        parts = [results.iloc[:0]]
        for one in self.findings:
            plain = one.measure == measure and one.columns == (PLACE,) and not one.plan.beside
            if plain and isinstance(one.test, Anova):
                own = one.plan.of(results)
                parts.append(own[own["participant"].isin(one.test.people)])
        return pd.concat(parts)

    def table(self, name: str) -> "pd.DataFrame":
        """Return one of the report's tables of tests."""
        import pandas as pd

        tests = [one.test for one in self.findings if one.table == name]
        return pd.DataFrame([row_of(test, self.factors) for test in tests if test is not None])

    def shortfalls(self) -> "pd.DataFrame":
        """Return what tests lack as a table; empty if all are of all participants and levels."""
        import pandas as pd

        rows = [
            {"measure": one.measure, "factor": one.effect, **asdict(short)}
            for one in lacking(self.findings)
            for short in one.short
        ]
        return pd.DataFrame(rows)

    def quantity(self, number: str, measure: str) -> str:
        """Return a number of a measure with its unit, if it has one."""
        unit = self.units.get(measure, "")
        return number if unit in {"", "1"} else f"{number} {unit}"


def findings_of(
    study: StudyMovements, everything: "pd.DataFrame", scores: "pd.DataFrame"
) -> list[StudyFinding]:
    """Return what came of every planned test: of movements, of practice, gaze and scores."""
    return [
        *of_outcomes(study),
        *of_contrasts(study),
        *of_trends(study),
        *of_time_scales(study),
        *of_practice(everything, study.factors, study.primary),
        *of_gaze_measures(study),
        *of_scores(scores, study.factors),
    ]


def of_outcomes(study: StudyMovements) -> Iterator[StudyFinding]:
    """Yield every test of every outcome over positions, distances, sides, phases and groups."""
    for measure in study.measures:
        tested: set[str] = set()
        for plan in plans(study.results, study.factors):
            for finding in _run("anova", plan, measure, study):
                if finding.test is not None:
                    tested.add(finding.effect)
                elif plan.beside and finding.effect.removesuffix(ADJUSTED) not in tested:
                    continue  # the finding before it states that positions cannot be tested at all
                yield finding


def _run(table: str, plan: Plan, measure: str, study: StudyMovements) -> Iterator[StudyFinding]:
    done, recorded = plan.of(study.results), plan.of(study.recorded)
    return _PlanRun(table, plan, measure, done, recorded, study.factors).findings()


def of_gaze_measures(study: StudyMovements) -> Iterator[StudyFinding]:
    """Yield the tests of how long each area was looked at, over groups, phases and distances."""
    plan = Plan((*study.factors.over_phases, DISTANCE))
    for measure in of_gaze(study.results):
        yield from _run("gaze_tests", plan, measure, study)


def of_contrasts(study: StudyMovements) -> Iterator[StudyFinding]:
    """Yield the differences of two levels; the test of all levels names who is missing."""
    for one in contrasts(study):
        yield StudyFinding("contrasts", one.measure, one.factor, one)


def of_practice(
    everything: "pd.DataFrame", factors: Factors, primary: Sequence[str] = ()
) -> Iterator[StudyFinding]:
    """Yield the tests of practice against counted movements; nothing without practice."""
    if not factors.practice:
        return
    done = practised(everything)
    recorded = everything.assign(practice=practice_words(everything))
    for measure in measures_in(done, primary):
        run = _PlanRun("practice", Plan((PRACTICE,)), measure, done, recorded, factors)
        for finding in run.findings():
            if PRACTICE in finding.columns:
                yield finding
            elif finding.test is not None:  # without the same people as practice
                yield replace(finding, short=())


def of_scores(scores: "pd.DataFrame", factors: Factors) -> Iterator[StudyFinding]:
    """Yield the tests of every score over occasions, conditions and groups."""
    groups = tuple(sorted({name for name in factors.people.values() if name}))
    factors = replace(factors, groups=groups if len(groups) > 1 else ())
    for outcome, own in occasions(scores, factors.people).groupby("outcome"):
        name = str(outcome)
        table = own.rename(columns={"value": name})
        yield from _PlanRun("score_tests", SCORE_OCCASIONS, name, table, table, factors).findings()
        if len(behind := after_conditions(table)):
            run = _PlanRun("score_tests", SCORE_CONDITIONS, name, behind, behind, factors)
            yield from run.findings()


def of_trends(study: StudyMovements) -> list[StudyFinding]:
    """Return the linear trends over positions in each phase; of primary outcomes, all share Holm.

    If none is named as primary, every outcome is.
    """
    several = [phase for phase in study.factors.phases if study.factors.places[phase] > 1]
    found = [_of_trend(study, measure, phase) for measure in study.measures for phase in several]
    tests = [(at, one.test) for at, one in enumerate(found) if isinstance(one.test, Trend)]
    corrected = [(at, one) for at, one in tests if one.measure in (study.primary or study.measures)]
    p_holm = holm([one.p for _, one in corrected])
    for (at, one), p in zip(corrected, p_holm, strict=True):
        found[at] = replace(found[at], test=replace(one, p_holm=p))
    return found


def _of_trend(study: StudyMovements, measure: str, phase: str) -> StudyFinding:
    name, people = f"linear trend of {SEQUENCE} in {phase}", study.factors.people
    own = study.results[study.results[PHASE] == phase].assign(sequence=lambda table: table[PLACE])
    places = own.dropna(subset=[measure]).groupby("participant")["sequence"].nunique()
    several = set(map(str, places[places > 1].index))
    trend = linear_trend(own, measure)
    if trend is None:
        why = f"{len(several)} of {len(people)} people have values at two or more positions"
        few = len(several) < LEAST
        why += f", and {LEAST} are needed" if few else ", whose slopes do not differ"
        short = Shortfall("", len(people), len(several), why)
        return StudyFinding("trends", measure, name, None, (short,))
    confounded = confounds(own, measure, trend.people, (PLACE,), of_pairs(study.results))
    there = set(study.recorded.loc[study.recorded[PHASE] == phase, "participant"])
    why_not = {True: "values at fewer than two positions", False: f"{NOTHING} in {phase}"}
    reasons = {who: why_not[who in there] for who in people if who not in trend.people}
    told = replace(trend, phase=phase, confounded=confounded)
    return StudyFinding("trends", measure, name, told, without_people(reasons, people))


def of_time_scales(study: StudyMovements) -> Iterator[StudyFinding]:
    """Yield learning within phases and from one to the next, and its tests between groups."""
    factors = study.factors
    for measure in study.measures:
        found = quantities(study.results, measure)
        for each in summary(found, measure, factors.people).to_dict("records"):
            row = {str(key): value for key, value in each.items()}
            row["confounded"] = between_phases(study.results, row, found, factors)
            short = _without_quantity(row, study)
            yield StudyFinding(
                "time_scales", measure, f"{row['quantity']} of {row['phase']}", row, short
            )
        for (phase, quantity), own in found.groupby(["phase", "quantity"], sort=False):
            about = {"phase": phase, "quantity": quantity, "adjustment": adjusted(own)}
            values = own.rename(columns={"value": measure})
            for test in analyse(values, measure, (), factors.between):
                row = row_of(test, factors) | about
                yield StudyFinding("time_scales_by_group", measure, f"{quantity} of {phase}", row)


def _without_quantity(row: Mapping[str, Any], study: StudyMovements) -> tuple[Shortfall, ...]:
    """Return who has no such quantity; a row without a test says so itself."""
    recorded, factors = study.recorded, study.factors
    if row["why"] or row["group"] != "all":
        return ()
    phases = [row["phase"]]
    if row["quantity"] in FROM_BEFORE:
        phases.insert(0, factors.phases[factors.phases.index(row["phase"]) - 1])
    few = {"slope": "values at fewer than two positions", "change": "no value in a phase"}
    reasons = {}
    for who in row["left_out"].split():
        mine = set(recorded.loc[recorded["participant"] == who, PHASE])
        away = [phase for phase in phases if phase not in mine]
        why = few.get(row["quantity"], "no value at a first or last position")
        reasons[who] = f"{NOTHING} in {' and '.join(away)}" if away else why
    return without_people(reasons, factors.people)


@dataclass(frozen=True)
class _PlanRun:
    """A plan that is run for one measure: its tests, and what they lack.

    Attributes
    ----------
    table
        The report's table of its tests.
    done
        The plan's rows whose values count.
    recorded
        All rows of the plan; they have every planned level.
    """

    table: str
    plan: Plan
    measure: str
    done: "pd.DataFrame"
    recorded: "pd.DataFrame"
    factors: Factors

    @cached_property
    def _known(self) -> "pd.DataFrame":
        return self.done.dropna(subset=[self.measure])

    @cached_property
    def _cells(self) -> FactorialDesign:
        return self.plan.cells(self.done, self.measure, self.factors.between)

    @cached_property
    def _levels(self) -> dict[str, list[Any]]:
        """Levels of the factors that were planned to vary."""
        planned = {name: sorted(self.recorded[name].dropna().unique()) for name in self.plan.within}
        planned[GROUP] = list(self.factors.groups)
        return {name: levels for name, levels in planned.items() if len(levels) > 1}

    def findings(self) -> Iterator[StudyFinding]:
        """Yield the tests that can be made, and then those that cannot."""
        plan, cells = self.plan, self._cells
        finding = partial(StudyFinding, self.table, self.measure, plan=plan, cells=cells)
        planned = [columns for columns in plan.effects if set(columns) <= set(self._levels)]
        asked = [
            columns for columns in self.factors.questions.values() if columns[1:] == plan.within
        ]
        tests = {tuple(test.factor.split(":")): test for test in plan.tests(cells, self.measure)}
        for columns, test in tests.items():
            name, confounded = self._name(columns), ""
            if plan.period:
                confounded = "" if test.beside else ORDER
            elif columns == (plan.asked or tuple(each for each in columns if each != GROUP)):
                confounded = self._confounds(test.people, columns)
            short = self._without(columns) if columns in planned else ()
            yield finding(name, replace(test, factor=name, confounded=confounded), short, columns)
        whole = len(cells.people) + len(cells.alone)
        for columns in (*planned, *asked):
            if columns not in tests:
                no_test = Shortfall("", len(self.factors.people), whole, self._why(columns))
                yield finding(self._name(columns), None, (no_test,), columns)

    def _confounds(self, people: Collection[str], effect: Sequence[str]) -> str:
        return confounds(self.done, self.measure, people, effect, self.plan.confusable)

    def _name(self, columns: tuple[str, ...]) -> str:
        return self.factors.named(":".join(columns)) + self.plan.suffix

    def _word(self, column: str) -> str:
        return self.factors.named(column)

    def _gone(self, column: str) -> list[Any]:
        """Return the planned levels of a factor within participants without any value."""
        levels = self._levels.get(column, []) if column in self.plan.within else []
        return [level for level in levels if not (self._known[column] == level).any()]

    def _without(self, columns: tuple[str, ...]) -> tuple[Shortfall, ...]:
        """Return what the test of an effect is without."""
        people, whole = self.factors.people, {*self._cells.people, *self._cells.alone}
        why = "no participant has a value there"
        found = [
            Shortfall(f"{self._word(column)} {word(level)}", len(people), 0, why)
            for column in columns
            for level in self._gone(column)
        ]
        for group in self._levels.get(GROUP, ()):
            members = {who for who, own in people.items() if own == group}
            if members and not members & whole:
                why = f"none of its {len(members)} people has a value in every cell"
                found.append(Shortfall(f"{GROUP} {group}", len(members), 0, why))
        return (*found, *without_people(self._missing, people))

    @cached_property
    def _missing(self) -> dict[str, str]:
        """Who is not in the tests, and why: the same for all effects of the plan."""
        names, reasons = list(self._cells.within), {}
        cells = set(product(*self._cells.within.values()))
        unseen = self.recorded[is_success(self.recorded) & not_presented(self.recorded)]
        known_in, done_in, recorded_in, unseen_in = (
            _cells_of(table, names) for table in (self._known, self.done, self.recorded, unseen)
        )
        for who, group in self.factors.people.items():
            if who in self._cells.alone:
                reasons[who] = f"alone in group {group}" if group else "in no group"
            elif who not in self._cells.people:
                lacks, done = cells - known_in[who], done_in[who]
                hidden = unseen_in[who] - done
                of_kind = {
                    NOTHING: lacks - recorded_in[who],
                    "no success": (lacks & recorded_in[who]) - done - hidden,
                    "no success that was shown": lacks & hidden,
                    "no value": lacks & done,
                }
                reasons[who] = " and ".join(
                    kind + self._where(own, cells) for kind, own in of_kind.items() if own
                )
        return reasons

    def _where(self, lacks: set[Cell], cells: set[Cell]) -> str:
        """Return a description of cells: all with some levels of one factor, or one by one."""
        if lacks == cells:
            return ""
        names = [self._word(name) for name in self._cells.within]
        for at, name in enumerate(names):
            levels = {cell[at] for cell in lacks}
            if lacks == {cell for cell in cells if cell[at] in levels}:
                return f" at {name} {', '.join(map(word, sorted(levels)))}"
        said = [
            ", ".join(f"{name} {word(level)}" for name, level in zip(names, cell, strict=True))
            for cell in sorted(lacks)
        ]
        return f" at {shortened(said, SHOWN, '; ')}"

    def _why(self, columns: tuple[str, ...]) -> str:
        """Return why an effect cannot be tested."""
        if self.plan.beside:  # positions can be, and not without what pairs of targets add
            apart = self._confounds(self._cells.people, self.plan.asked)
            few = "there are too few people to estimate their variance"
            return f"positions cannot be distinguished from {apart}" if apart else few
        for column in columns:
            gone = self._gone(column)
            if gone and len(self._levels[column]) - len(gone) < 2:  # noqa: PLR2004 - to compare
                levels = ", ".join(map(word, gone))
                return f"no participant has a value at {self._word(column)} {levels}"
        varied = " and ".join(map(self._word, self._cells.within))
        have = "a value" + (f" in every cell of {varied}" if varied else "")
        whole, single = len(self._cells.people), len(self._cells.alone)
        if whole < LEAST:
            why = f"{whole + single} of {len(self.factors.people)} people have {have}"
            if whole + single >= LEAST:
                why += f", {single} of them alone in a group or in none"
            empty = [", ".join(map(word, cell)) for cell in self._cells.empty]
            nobody = f"; no participant has one at {shortened(empty, SHOWN, '; ')}" if empty else ""
            return f"{why}, and {LEAST} are needed{nobody}"
        groups = {self.factors.people.get(who, "") for who in self._cells.people}
        if len(groups) < 2 and GROUP in columns:  # noqa: PLR2004
            return f"all {whole} people with {have} are in group {groups.pop()}"
        return f"the {whole} people with {have} do not differ in the tested values"


def _cells_of(table: "pd.DataFrame", names: Sequence[str]) -> defaultdict[str, set[Cell]]:
    """Return the cells in which each participant has rows; the only one if there are no factors."""
    found: defaultdict[str, set[Cell]] = defaultdict(set)
    rows = table[["participant", *names]].drop_duplicates()
    for who, *cell in rows.itertuples(index=False, name=None):
        found[who].add(tuple(cell))
    return found


def without_people(reasons: Mapping[str, str], people: Collection[str]) -> tuple[Shortfall, ...]:
    """Return who of the sample is not in a test, by their reasons; empty if all are in it."""
    if not reasons:
        return ()
    of_reason: defaultdict[str, list[str]] = defaultdict(list)
    for who, reason in reasons.items():
        of_reason[reason].append(who)
    why = "; ".join(f"{people_in_words(own)}: {reason}" for reason, own in of_reason.items())
    if len(of_reason) == 1:
        (why,) = of_reason
    gone = [who for own in of_reason.values() for who in own]
    return (Shortfall(people_in_words(gone), len(people), len(people) - len(gone), why),)


def people_in_words(names: Sequence[str]) -> str:
    """Return names in words: ``P001, P002 and P003``."""
    if len(names) > NAMED:
        return shortened(names, NAMED)
    *others, last = sorted(names)
    return f"{', '.join(others)} and {last}" if others else last


def lacking(findings: Iterable[StudyFinding]) -> Iterator[StudyFinding]:
    """Yield the findings with shortfalls; in a plan, groups are after what varies within people."""
    for _, own in groupby(findings, key=lambda one: (one.measure, one.plan)):
        short = [one for one in own if one.short]
        yield from sorted(short, key=lambda one: one.columns == (GROUP,))
