"""Scales of questionnaires as they stand on the page: measured by their boxes in Chromium."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from faults.sessions import wait_for
from pages.room import photograph, text
from pages.test_states import Told, opened, pages
from PIL import Image
from rehearsal import loaded
from selenium import webdriver
from selenium.webdriver.common.by import By

pytestmark = pytest.mark.slow

WIDTHS = (360, 768, 1280, 1920)
FINGER = 24.0
"""Pixels: the least target of WCAG 2.2, 2.5.8."""
SHORT = """\
  short: {use: subjective_accuracy}
"""
BOXES = """
return [...document.querySelectorAll('.form-item')].map(card => {
    const box = e => {
        const b = e.getBoundingClientRect();
        return [b.left, b.top, b.right, b.bottom];
    };
    return {
        card: box(card), ends: [...card.querySelectorAll('.form-ends > *')].map(box),
        ticks: [...card.querySelectorAll('.form-scale button')].map(box),
        cut: [...card.querySelectorAll('.form-scale button')].filter(
            e => e.scrollWidth > e.clientWidth + 1).map(e => e.innerText),
    };
});
"""


def sized(browser: webdriver.Chrome, width: int) -> None:
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def asked(told: Told, browser: webdriver.Chrome, name: str) -> None:
    opened(browser, told.links["participant"])
    told.happens(
        ("consent.given", {"version": "a", "by": "participant"}),
        ("questionnaire.start", {"questionnaire": name, "title": name, "kept": json.dumps({})}),
    )
    wait_for(lambda: text(browser, "answered"))


@pytest.mark.parametrize("name", ["load", "short"])
def test_a_scale_is_one_row_or_on_a_phone_one_column_between_its_anchors_for_a_finger(
    name: str, tmp_path: Path, browser: webdriver.Chrome
) -> None:
    with pages(tmp_path, SHORT) as told:
        items = loaded(told.order.protocol).questionnaires[name].items()
        asked(told, browser, name)
        for width in WIDTHS:
            sized(browser, width)
            scales = browser.execute_script(BOXES)
            assert len(scales) == len(items)
            for item, scale in zip(items, scales, strict=True):
                ticks, card = np.array(scale["ticks"]), scale["card"]
                assert len(ticks) == round((item.highest - item.lowest) / item.step) + 1
                column = name == "load" and width == WIDTHS[0]
                along, across = (1, 0) if column else (0, 1)
                assert np.ptp(ticks[:, across]) < 1.0, f"{item.name} breaks at {width} px"
                assert (np.diff(ticks[:, along]) > 0.0).all()
                sizes = ticks[:, 2:] - ticks[:, :2]
                assert np.ptp(sizes, axis=0).max() < 1.0, "steps are equally large"
                assert sizes.min() >= FINGER
                assert card[0] < ticks[0, 0] < ticks[-1, 2] < card[2] <= width
                low, high = scale["ends"]
                assert low[0] == pytest.approx(ticks[0, 0], abs=1.0)
                assert high[2] == pytest.approx(ticks[-1, 2], abs=1.0)
                assert low[3] <= ticks[0, 1]
                assert high[1] >= ticks[-1, 3] or not column
                assert scale["cut"] == [], f"{item.name} at {width} px"
        names = [
            each.accessible_name
            for each in browser.find_elements(By.CSS_SELECTOR, ".form-scale button")
        ]
        ticks = np.arange(items[0].lowest, items[0].highest + 1e-9, items[0].step)
        assert names[: len(ticks)] == [f"{tick:g}" for tick in ticks]


def test_the_bar_of_answers_is_as_full_as_there_are_answers(
    tmp_path: Path, browser: webdriver.Chrome
) -> None:
    with pages(tmp_path) as told:
        asked(told, browser, "load")
        sized(browser, 1280)
        items = loaded(told.order.protocol).questionnaires["load"].items()
        for done, item in enumerate(("", *(each.name for each in items))):
            if item:
                told.happens(("questionnaire.answer", {"item": item, "value": 50.0}))
            wait_for(lambda done=done: text(browser, "answered").startswith(f"{done} of "))
            bar = browser.find_element(By.TAG_NAME, "progress")
            picture = np.asarray(Image.open(io.BytesIO(bar.screenshot_as_png)).convert("L"), float)
            middle = picture[len(picture) // 2, 2:-2]
            assert (middle < 160.0).mean() == pytest.approx(done / len(items), abs=0.02)


WORDED = """\
  worded:
    use: free
    title: Sleepiness
    questions:
      - name: rating
        text: How sleepy?
        lowest: 1
        highest: 9
        words:
          1: extremely alert
          5: neither alert nor sleepy
          9: very sleepy, great effort to keep awake, fighting sleep all the time
"""


def test_a_scale_whose_steps_have_words_is_a_list_of_them(
    tmp_path: Path, browser: webdriver.Chrome
) -> None:
    with pages(tmp_path, WORDED) as told:
        asked(told, browser, "worded")
        for width in WIDTHS:
            sized(browser, width)
            steps = browser.find_elements(By.CSS_SELECTOR, ".form-steps button")
            assert [each.text.split(None, 1)[0] for each in steps] == [*"123456789"]
            assert "neither alert nor sleepy" in steps[4].text
            boxes = [each.rect for each in steps]
            assert len({box["x"] for box in boxes}) == 1
            assert all(box["x"] >= 0 and box["x"] + box["width"] <= width for box in boxes)
            below = zip(boxes[1:], boxes, strict=False)
            assert all(low["y"] >= high["y"] + high["height"] for low, high in below)
            wide = browser.execute_script(
                "return [...document.querySelectorAll('.form-steps button')].filter("
                "e => e.scrollWidth > e.clientWidth + 1).length"
            )
            assert wide == 0, f"words are cut at {width} px"
        photograph(browser, "worded")


TENTHS = """\
  worded:
    use: free
    title: How often
    questions:
      - name: often
        text: How often?
        highest: 1
        step: 0.1
        words: {0: never, 0.3: seldom, 0.6: often, 0.7: mostly, 1: always}
"""


def test_words_at_tenths_are_all_on_the_page_and_the_step_that_is_answered_is_marked(
    tmp_path: Path, browser: webdriver.Chrome
) -> None:
    with pages(tmp_path, TENTHS) as told:
        asked(told, browser, "worded")
        steps = browser.find_elements(By.CSS_SELECTOR, ".form-steps button")
        said = [" ".join(each.text.split()) for each in steps]
        assert said == [
            "0 never", "0.1", "0.2", "0.3 seldom", "0.4", "0.5", "0.6 often", "0.7 mostly", "0.8",
            "0.9", "1 always",
        ]  # fmt: skip
        told.happens(("questionnaire.answer", {"item": "often", "value": 0.3}))
        wait_for(lambda: steps[3].get_attribute("aria-pressed") == "true")


def test_the_titles_of_a_pair_stand_on_the_sides_that_the_record_says(
    tmp_path: Path, browser: webdriver.Chrome
) -> None:
    weighted = "  pairs: {use: nasa_tlx, weighted: true}\n"
    with pages(tmp_path, weighted) as told:
        items = loaded(told.order.protocol).questionnaires["pairs"].items()
        order = " ".join(item.name for item in items)
        opened(browser, told.links["participant"])
        start = {"questionnaire": "pairs", "title": "Load", "kept": "{}", "order": order}
        told.happens(
            ("consent.given", {"version": "a", "by": "participant"}),
            ("questionnaire.start", {**start, "turned": "mental_or_effort"}),
        )
        wait_for(lambda: text(browser, "answered"))
        for name, titles in (
            ("mental_or_physical", ["Mental demand", "Physical demand"]),
            ("mental_or_effort", ["Effort", "Mental demand"]),
        ):
            card = browser.find_element(By.ID, f"item-{name}")
            buttons = card.find_elements(By.CSS_SELECTOR, ".form-choices button")
            assert [each.text for each in buttons] == titles
            asks = text(browser, f"asked-{name}")
            assert asks.endswith(": {} or {}?".format(*titles))
