"""The report as it is read: the answer first, figures that journals print, a page for everybody."""

import re
from collections.abc import Callable, Iterator
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from pages.looks import check
from pages.room import a_browser

from labcrane.analysis import find_cohort
from labcrane.analysis.report import figures
from labcrane.analysis.report.answer import answer
from labcrane.analysis.report.factors import factors_of, with_factors
from labcrane.analysis.report.findings import Results, of_outcomes
from labcrane.analysis.report.html import Page
from labcrane.analysis.report.outcomes import StudyMovements
from labcrane.analysis.report.report import write_report
from labcrane.analysis.report.style import COLUMN, MM, PAGE, new_figure
from labcrane.analysis.statistics.fitts import throughput
from labcrane.analysis.statistics.learning import learning_curves
from labcrane.analysis.tables.definitions import MEASURES
from results.synthetic import cohort_of_36
from results.tested import COUNTS

GROUPS = ("none", "visual", "sound")


@pytest.fixture(scope="module")
def movements() -> pd.DataFrame:
    """36 participants in three groups, with everything that a figure shows."""
    table = cohort_of_36()
    dice = np.random.default_rng(3)
    for name in ("simultaneous", "bimanual", "reversals"):
        table[name] = dice.random(len(table))
    people = table["participant"].str[1:].astype(int)
    table["group"] = [GROUPS[number % 3] for number in people]
    table["circle_to_circle"] = table["movement_time"] + 1.0
    return table.assign(outcome="success", practice=0.0, session=1.0, attempt=1.0)


@pytest.fixture(scope="module")
def placed(movements: pd.DataFrame) -> pd.DataFrame:
    """The same, with the factors that figures are drawn by."""
    return with_factors(movements)


def learned(movements: pd.DataFrame) -> figures.Drawing:
    curves = learning_curves(movements, "movement_time")
    return figures.learning(movements, curves, "movement_time")


DRAWN: dict[str, Callable[[pd.DataFrame], figures.Drawing]] = {
    "by sequence": lambda table: figures.by_sequence(table, "movement_time"),
    "by distance": figures.by_distance,
    "learning": learned,
    "fitts": figures.fitts,
    "throughput": lambda table: figures.throughputs(throughput(table)),
    "sticks": figures.sticks,
}


@pytest.fixture(scope="module")
def drawings(placed: pd.DataFrame) -> dict[str, figures.Drawing]:
    return {name: draw(placed) for name, draw in DRAWN.items()}


def texts(figure: Figure) -> Iterator[tuple[str, tuple[float, float, float, float]]]:
    """Yield every text of a figure that is to be seen, with where it is, in pixels."""
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    beyond = [
        label
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]
        for label in (tick.label1, tick.label2)
        if not min(axis.get_view_interval()) <= tick.get_loc() <= max(axis.get_view_interval())
    ]
    for text in figure.findobj(Text):
        if text in beyond:
            continue  # matplotlib does not draw it
        box = text.get_window_extent(renderer)
        if text.get_visible() and text.get_text().strip() and box.width > 1:
            yield text.get_text(), (box.x0, box.y0, box.x1, box.y1)


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWN)
def test_no_text_of_a_figure_of_36_people_is_cut_or_over_another(
    name: str, drawings: dict[str, figures.Drawing]
) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = drawings[name].figure
    FigureCanvasAgg(figure)
    found = dict.fromkeys(texts(figure))
    assert len(found) > 5
    width, height = figure.bbox.width, figure.bbox.height
    for said, (left, low, right, high) in found:
        assert min(left, low) >= -1, said
        assert right <= width + 1, said
        assert high <= height + 1, said
    for (one, a), (other, b) in combinations(found, 2):
        wide = min(a[2], b[2]) - max(a[0], b[0])
        tall = min(a[3], b[3]) - max(a[1], b[1])
        assert wide < 1 or tall < 1, f"{one!r} and {other!r} are over each other"


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWN)
def test_a_figure_has_a_journals_width_letters_of_seven_points_and_its_n(
    name: str, drawings: dict[str, figures.Drawing]
) -> None:
    drawing = drawings[name]
    width, height = drawing.figure.get_size_inches()
    assert min(abs(width - COLUMN), abs(width - PAGE)) < 1e-9
    assert height <= 240 * MM, "higher than a page"
    sizes = {each.get_fontsize() for each in drawing.figure.findobj(Text) if each.get_text()}
    assert min(sizes) >= 7.0
    assert "n = 36 participants" in drawing.caption
    has_bars = name in {"by sequence", "by distance", "sticks"}
    assert ("bars: 95 % confidence intervals" in drawing.caption) == has_bars


@pytest.mark.slow
def test_everybody_is_to_be_seen_in_every_figure(drawings: dict[str, figures.Drawing]) -> None:
    for name, drawing in drawings.items():
        axes = drawing.figure.axes[0]
        points = max(len(line.get_xdata()) for line in axes.lines)
        assert len(axes.lines) >= 36 or points >= 36, name


def told(
    movements: pd.DataFrame, data: Path, primary: tuple[str, ...] = ()
) -> dict[str, list[str]]:
    whole = with_factors(movements)
    factors = factors_of(whole)
    tests = list(of_outcomes(StudyMovements(whole, whole, factors, primary)))
    units = {"movement_time": "s", **{name: unit for name, (unit, _) in MEASURES.items()}}
    results = Results("36 participants.", COUNTS, factors, tests, primary, units)
    loops = pd.DataFrame({
        "late_ticks": [3, 0], "ticks": [1000, 1000], "lateness_worst_ms": [12.5, 1.0],
        "sync_verdict": ["WARN", "PASS"], "not_there": ["eeg, gaze", "eeg"],
    })  # fmt: skip
    cohort = find_cohort(data, ["half-finished"])
    return answer(cohort, movements, (loops, pd.DataFrame()), "36 participants.", results)


@pytest.mark.slow
def test_the_answer_has_design_people_effects_quality_and_exclusions_with_their_numbers(
    movements: pd.DataFrame, data: Path
) -> None:
    lost = movements.assign(outcome=["timeout", *["success"] * (len(movements) - 1)])
    found = told(lost, data)
    assert list(found) == [
        "Design", "Participants", "Effects", "Data quality", "Exclusions",
    ]  # fmt: skip
    assert "3 groups (none, sound, visual)" in found["Design"][0]
    time = found["Effects"][0]
    kept = lost[lost["outcome"] == "success"]
    for distance in (2.0, 3.0, 4.0, 6.0):
        own = kept[kept["distance"] == distance].groupby("participant")["movement_time"].mean()
        assert f"{distance:g} m: {own.mean():.3g} s" in time
    assert re.search(r"differed over distance \(.*F\([\d.]+, [\d.]+\) = [\d.]+, p < .001", time)
    assert "did not detectably differ over group" in time
    assert found["Data quality"][0] == (
        "2 sessions of 2,000 ticks: 3 were late (0.150%), the worst by 12.5 ms."
    )
    assert found["Data quality"][1:] == [
        "Timestamps by their sync reports: 1 WARN, 1 PASS.",
        "Absent in a rehearsal, and not judged: eeg, gaze.",
    ]
    assert found["Exclusions"] == [
        f"1 of {len(lost)} movements are excluded from means (0.1%); each is listed with its "
        "reason.",
    ]
    assert "Left out: " in found["Participants"][1]


def paper_of(movements: pd.DataFrame, measure: str) -> tuple[str, str]:
    """Return F and corrected df over positions, plain as a paper has them, by statsmodels."""
    from statsmodels.stats.anova import AnovaRM

    cells = movements.groupby(["participant", "sequence"])[measure].mean().reset_index()
    row = AnovaRM(cells, measure, "participant", within=["sequence"]).fit().anova_table.iloc[0]
    wide = cells.pivot_table(index="participant", columns="sequence", values=measure)
    ranks = np.cov(wide.to_numpy(float), rowvar=False)
    k = len(ranks)
    centred = (np.eye(k) - 1 / k) @ ranks @ (np.eye(k) - 1 / k)
    epsilon = np.trace(centred) ** 2 / ((k - 1) * (centred**2).sum())
    free = f"{epsilon * row['Num DF']:.2f}, {epsilon * row['Den DF']:.2f}"
    return free, f"{row['F Value']:.2f}"


@pytest.mark.slow
def test_the_answer_gives_the_plain_test_of_the_primary_outcome_and_names_the_adjusted_one(
    movements: pd.DataFrame, data: Path
) -> None:
    table = movements.drop(columns="group")
    time, error = told(table, data, primary=("absolute_error",))["Effects"][1::-1]
    assert error.startswith("Primary outcome: The distance from the target's centre ")
    assert time.startswith("Further outcome: ")
    for said, measure in ((time, "movement_time"), (error, "absolute_error")):
        free, f = paper_of(table, measure)
        plain, adjusted = re.findall(r"over sequence( with pairs' means taken away)? \(", said)
        assert (plain, adjusted) == ("", " with pairs' means taken away")
        (begin,) = re.findall(r"over sequence \(position 1: [^;]*; F\(([^)]*)\) = ([\d.]+),", said)
        assert begin == (free, f)


def test_without_primary_outcomes_none_is_called_so(movements: pd.DataFrame, data: Path) -> None:
    assert "rimary" not in "".join(told(movements, data)["Effects"])


def test_positions_of_phases_of_other_lengths_are_in_the_answer(
    movements: pd.DataFrame, data: Path
) -> None:
    second = movements[movements["sequence"] <= 5].assign(session=2.0)
    said = told(pd.concat([movements, second]), data)["Effects"][0]
    for phase, last in (("1 session 1", 8), ("2 session 2", 5)):
        assert re.search(rf"over sequence in {phase} \(position 1: [^;]*, position {last}: ", said)


@pytest.mark.slow
def test_the_answer_names_movements_without_an_onset(movements: pd.DataFrame, data: Path) -> None:
    still = movements["participant"].isin(["P003", "P008"]) & (movements["trial"] == 17)
    onset = np.where(still, np.nan, 0.4)
    found = told(movements.assign(movement_onset=onset), data)
    assert found["Exclusions"] == [
        f"2 of {len(movements)} movements are excluded from means (0.2%); each is listed with its "
        "reason. Without an onset: P003 trial 17, P008 trial 17."
    ]


def test_the_answer_stands_first_then_the_contents_and_tables_are_folded(
    tmp_path: Path,
) -> None:
    page = Page("A <study>", tmp_path / "report.html", tmp_path)
    for name in ("one", "two", "three", "four"):
        page.heading(name)
        page.table(name, pd.DataFrame({"a": [1.0]}))
    page.draw(figures.Drawing("drawn", "A line", new_figure(), pd.DataFrame({"a": [1.0]})))
    page.lead({"Design": ["within"], "Nothing": []})
    text = page.write().read_text(encoding="utf-8")
    order = [
        text.index(part) for part in ("<h1>", 'class="lead"', "<figure", "<nav", 'id="section-1"')
    ]
    assert order == sorted(order)
    assert "Nothing" not in text
    assert text.count("<figure") == 1
    assert "A &lt;study&gt;" in text
    assert text.count("<details>") == text.count("<table") == 4
    assert re.findall(r'href="#section-(\d)"', text) == ["1", "2", "3", "4"]


SEEN = """
return [...document.querySelectorAll('table')].filter(each => each.checkVisibility()).length
"""
"""How many tables are to be seen."""
TOP = "return document.querySelector('figure').getBoundingClientRect().top"


@pytest.mark.long
def test_the_report_is_for_everybody_and_nothing_of_it_is_cut(data: Path, tmp_path: Path) -> None:
    page = write_report(find_cohort(data, ["half-finished", "simulated"]), tmp_path / "report")
    with a_browser(tmp_path / "profile") as browser:
        for each in (page, page.parent / "participants" / "P001.html"):
            browser.get(each.as_uri())
            check(browser, each.stem)
            browser.execute_script(
                "document.querySelectorAll('details').forEach(e => { e.open = true; })"
            )
            check(browser, f"{each.stem}, unfolded")
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {
                "features": [{"name": "prefers-color-scheme", "value": "dark"}]
            })  # fmt: skip
            check(browser, f"{each.stem}, dark")
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
            browser.refresh()
            assert browser.execute_script(SEEN) == 0
            if each == page:
                assert browser.execute_script(TOP) < 800, "a figure is on the first screen"
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
            assert browser.execute_script(SEEN) == browser.execute_script(
                "return document.querySelectorAll('table').length"
            )
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
