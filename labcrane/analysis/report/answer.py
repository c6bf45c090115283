"""Answer of a study: the first page of its report, in words with their numbers."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from labcrane.analysis.cohort import Cohort
from labcrane.analysis.presented import not_presented
from labcrane.analysis.quality import is_result, without_onset
from labcrane.analysis.report.factors import GROUP, PLACE
from labcrane.analysis.report.findings import NAMED, Results, StudyFinding, people_in_words
from labcrane.analysis.report.sample import counted
from labcrane.analysis.report.words import (
    NAMES,
    STYLES,
    UNBALANCED,
    UNTESTED,
    depends,
    f_test,
    level,
    shortfalls,
    verdict,
)
from labcrane.analysis.statistics.anova import Anova, Contrast, marginal_means, word
from labcrane.analysis.statistics.trends import Trend
from labcrane.errors import shortened

if TYPE_CHECKING:
    import pandas as pd

STYLE = STYLES["html"]
TESTED = "Tests need three or more participants with a value in every cell; there are none here."


def answer(
    cohort: Cohort,
    everything: "pd.DataFrame",
    quality: "tuple[pd.DataFrame, pd.DataFrame]",
    about: str,
    results: Results | None,
) -> dict[str, list[str]]:
    """Return the paragraphs of the first page by topic.

    Parameters
    ----------
    everything
        All movements, also those excluded from means.
    quality
        Tables of the loop and of the clocks.
    about
        The sample in a sentence.
    results
        The tests; None for a study without tests.
    """
    return {
        "Design": [_design(cohort, everything, results)],
        "Participants": [about, *_left_out(cohort), *_untested(results)],
        "Effects": _effects(results),
        "Data quality": list(_quality(*quality)),
        "Exclusions": [_exclusions(everything)],
    }


def _design(cohort: Cohort, everything: "pd.DataFrame", results: Results | None) -> str:
    context = cohort.included[0].context
    sessions = int(everything["session"].nunique()) if len(everything) else 0
    said = f"{context.get('title') or context.get('study', 'A study')}: "
    said += f"{counted(sessions, 'session')} with movements"
    if results is None:
        return f"{said}. No tests were made."
    factors = results.factors
    within = [factors.named(name) for name in factors.tested if name != GROUP]
    absent = [name for name in factors.groups if name not in set(everything[GROUP])]
    empty = f"; {' and '.join(absent)} without movements" if absent else ""
    between = (
        f"Between participants: {len(factors.groups)} groups ({', '.join(factors.groups)}{empty})."
        if factors.groups
        else "There are no groups."
    )
    merged = f" {UNBALANCED}." if factors.unbalanced else ""
    uneven = f" {factors.uneven}" if factors.uneven else ""
    return f"{said}. Within participants: {', '.join(within)}. {between}{merged}{uneven}"


def _left_out(cohort: Cohort) -> list[str]:
    counts = Counter(str(person.status) for person in cohort.left_out)
    if not counts:
        return ["All recordings are included."]
    listed = ", ".join(f"{count} {status}" for status, count in counts.items())
    return [f"Left out: {listed}; each with the reason in the table of participants."]


def _untested(results: Results | None) -> list[str]:
    """Return who of the sample is not in every test, and where the reasons are."""
    if results is None:
        return []
    tests = [one.test for one in results.findings if one.table != "practice"]
    tested = [set(test.people) for test in tests if isinstance(test, Anova | Contrast | Trend)]
    names = {who for who in results.factors.people if any(who not in own for own in tested)}
    if not names:
        return []
    said = people_in_words(sorted(names))
    return [f"Not in every test, for the reasons given: {said}."]


def _effects(results: Results | None) -> list[str]:
    if results is None:
        return []
    factors = results.factors
    asked = [*factors.questions.values(), *((column,) for column in factors.tested)]
    paragraphs = []
    for measure in results.measures("anova"):
        own = results.of(measure)
        others = depends(own, factors)
        said = [
            _effect(one, one.test, results, others.get(one.effect, ""))
            for columns in asked
            for one in own
            if one.table == "anova" and one.columns == columns and isinstance(one.test, Anova)
        ]
        # People missing from tests that the answer leaves out are named in the words.
        short = shortfalls((one for one in own if one.columns in asked or one.test is None), STYLE)
        if said or short:
            effects = "; ".join(said) or UNTESTED
            about = f"{NAMES.get(measure, measure)} {effects}."
            paragraphs.append(" ".join([*_standing(measure, results.primary), about, *short]))
    return paragraphs or [TESTED]


def _standing(measure: str, primary: Sequence[str]) -> list[str]:
    """Return the protocol's word for outcomes; empty if it names no primary ones."""
    if not primary:
        return []
    return ["Primary outcome:" if measure in primary else "Further outcome:"]


def _effect(finding: StudyFinding, test: Anova, results: Results, depending: str) -> str:
    """Return ``differed over distance (2 m: 3.21 s, 6 m: 5.40 s; F(1, 35) = 90.1, p < .001)``.

    The means are those that the test compares: of those who are in it, with equal weights of its
    design's cells and groups.
    """
    if test.confounded:
        return f"the effect of {finding.effect} cannot be distinguished from {test.confounded}"
    columns, cells = finding.columns, finding.cells
    said, tested = verdict(test, STYLE), f_test(test, STYLE, results.people)
    if cells is None or finding.plan.beside:  # the means are those of the plain test, before it
        return f"{said} ({tested}){depending}"
    means = list(marginal_means(cells, columns).items())
    if columns == (PLACE,):  # the first and the last are enough
        means = [means[0], means[-1]]
    sizes = Counter(results.factors.people[who] for who in test.people)
    levels = ", ".join(
        " ".join(level(name, word(part)) for name, part in zip(columns, at, strict=True))
        + (f", n = {sizes[at[0]]}" if columns == (GROUP,) else "")
        + f": {results.quantity(f'{mean:.3g}', test.measure)}"
        for at, mean in means
    )
    return f"{said} ({levels}; {tested}){depending}"


def _quality(loops: "pd.DataFrame", syncs: "pd.DataFrame") -> Iterator[str]:
    late, ticks = int(loops["late_ticks"].sum()), int(loops["ticks"].sum())
    yield (
        f"{len(loops)} sessions of {ticks:,} ticks: {late:,} were late ({late / max(1, ticks):.3%}"
        f"), the worst by {loops['lateness_worst_ms'].max():.1f} ms."
    )
    verdicts = Counter(word for word in loops["sync_verdict"].astype(str) if word)
    if verdicts:
        listed = ", ".join(f"{count} {word}" for word, count in verdicts.most_common())
        yield f"Timestamps by their sync reports: {listed}."
    absent = [name for each in loops["not_there"] for name in each.split(", ") if name]
    if absent:
        names = ", ".join(dict.fromkeys(absent))
        yield f"Absent in a rehearsal, and not judged: {names}."
    if len(syncs):
        unknown = int((syncs["corrected"] == "no").sum())
        yield (
            f"{len(syncs)} external streams were recorded, {unknown} of them without a time on "
            "the session's clock."
        )


def _exclusions(everything: "pd.DataFrame") -> str:
    count = len(everything)
    out = count - int(is_result(everything).sum()) if count else 0
    share = f" ({out / count:.1%})" if count else ""
    said = (
        f"{out} of {count} movements are excluded from means{share}; each is listed with its "
        "reason."
    )
    unseen = everything[not_presented(everything)]
    if len(unseen):
        people = unseen["participant"].nunique()
        who = counted(people, "participant")
        said += (
            f" The operator saw or heard too little of {len(unseen)}, from {who}: {listed(unseen)}."
        )
    still = everything[without_onset(everything)]
    return f"{said} Without an onset: {listed(still)}." if len(still) else said


def listed(movements: "pd.DataFrame") -> str:
    """Return movements by name: ``P003 trial 17, P008 session 2 trial 4 and 3 more``."""
    several = movements["session"].nunique() > 1 if "session" in movements else False
    names = [
        f"{row['participant']} "
        + (f"session {row['session']:g} " if several else "")
        + f"trial {row['trial']:g}"
        for row in movements.to_dict("records")
    ]
    return shortened(names, NAMED)
