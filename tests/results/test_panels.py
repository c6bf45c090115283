"""Figures as plain SVG: every number of them is where it belongs."""

import math
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from labcrane.analysis.report.panels import Panel, Series, figure_of, svg_of, ticks

SVG = "{http://www.w3.org/2000/svg}"


def dots(text: str) -> np.ndarray:
    circles = ET.fromstring(text).iter(f"{SVG}circle")
    return np.array([(float(one.get("cx")), float(one.get("cy"))) for one in circles])


def test_dots_are_where_the_labelled_grid_says_they_are() -> None:
    dice = np.random.default_rng()
    x, y = dice.uniform(-3.0, 40.0, 50), dice.uniform(0.2, 7.0, 50)
    text = svg_of([Panel("across", "up", [Series(x, y, kind="dots")])])
    labels = list(ET.fromstring(text).iter(f"{SVG}text"))
    across = [each for each in labels if float(each.get("y")) == float(labels[0].get("y"))]
    up = [each for each in labels if each.get("text-anchor") == "end"]
    for at, found, place, free in ((0, across, "x", 0.0), (1, up, "y", 3.5)):
        values = [float(each.text) for each in found]
        points = [float(each.get(place)) - free for each in found]
        slope, origin = np.polyfit(values, points, 1)
        np.testing.assert_allclose(points, origin + slope * np.array(values), atol=0.1)
        drawn = (dots(text)[:, at] - origin) / slope
        np.testing.assert_allclose(drawn, (x, y)[at], atol=0.5 / abs(slope))


def test_what_is_no_number_is_left_out_and_words_are_words() -> None:
    y = np.array([1.0, math.nan, 3.0])
    bars = np.array([[0.5, 0.0, 0.0], [0.5, 0.0, 0.0]])
    panel = Panel("<s>", "a & b", [Series(np.arange(3.0), y, label="one", reach=bars)])
    text = svg_of([panel, panel])
    assert len(dots(text)) == 4
    assert "NaN" not in text
    assert "nan" not in text
    words = [each.text for each in ET.fromstring(text).iter(f"{SVG}text")]
    assert words.count("<s>") == words.count("a & b") == 2


@pytest.mark.parametrize("y", [np.empty(0), np.array([math.nan]), np.array([2.0])])
def test_nothing_or_one_number_is_a_figure_too(y: np.ndarray) -> None:
    text = svg_of([Panel("x", "y", [Series(np.arange(float(len(y))), y)])])
    assert len(dots(text)) == np.isfinite(y).sum()


def test_ticks_are_few_and_round_and_within_their_axis() -> None:
    dice = np.random.default_rng()
    for low, size in zip(
        dice.normal(0.0, 50.0, 300), 10.0 ** dice.uniform(-4, 5, 300), strict=True
    ):
        found = np.array(ticks(low, low + size))
        assert 2 <= len(found) <= 7
        assert found[0] >= low - 1e-6 * size
        assert found[-1] <= low + size * (1.0 + 1e-6)
        step = np.diff(found).mean()
        digits = step / 10.0 ** math.floor(math.log10(step) + 1e-9)
        assert min(abs(digits - each) for each in (1.0, 2.0, 2.5, 5.0)) < 1e-6


def test_matplotlib_draws_the_same_numbers() -> None:
    x, y = np.arange(5.0), np.random.default_rng().normal(size=5)
    panel = Panel("across", "up", [Series(x, y, "#123456", "line", "one")], "title")
    (axes,) = figure_of([panel]).axes
    (line,) = axes.get_lines()
    np.testing.assert_array_equal(line.get_xydata(), np.column_stack([x, y]))
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("across", "up", "title")
    assert (line.get_color(), line.get_marker()) == ("#123456", "")
