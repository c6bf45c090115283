"""A page whose server is stopped or killed: it says that it is old, and comes back by itself."""

import signal
import time
from pathlib import Path

import pytest
from faults.sessions import wait_for
from pages.looks import check
from pages.room import press, shown, text
from pages.test_control_room import keys
from pages.test_states import ASKED, BEGUN, opened, pages
from selenium import webdriver
from selenium.webdriver.common.by import By

from labcrane.web.translations import WORDS

pytestmark = pytest.mark.long

COLOUR = """
const [r, g, b] = getComputedStyle(document.querySelector('.room-bulb')).backgroundColor
    .match(/\\d+/g).map(Number);
return Math.max(r, g, b) - Math.min(r, g, b);
"""
"""How colourful the lamp is: 0 for a grey."""

PRESSABLE = """
const all = [...document.querySelectorAll('button, select, input[type=range]')];
return all.filter(e => !e.inert).length;
"""

WALL = "document.querySelector('.room').classList.toggle('wall')"
OLD_WALL = """
const style = (which) => getComputedStyle(document.querySelector(which));
return [Math.min(60, parseFloat(style('#stale').fontSize)), style('.room-big').visibility];
"""
"""On the wall: how large the banner is, up to 60 px, and whether an old status is seen."""


def waits(browser: webdriver.Chrome, words: str) -> float:
    """Return how long it took until the page said that it is old."""
    began = time.monotonic()
    wait_for(lambda: words in text(browser, "stale"))
    return time.monotonic() - began


@pytest.mark.timeout(300)
def test_the_control_room_of_a_server_that_stands_still_or_dies_says_so_and_orders_nothing(
    tmp_path: Path, browser: webdriver.Chrome
) -> None:
    with pages(tmp_path) as told:
        opened(browser, told.links["supervisor"])
        told.happens(*BEGUN["waiting"])
        shown(browser, "order-start", "Start: aim")
        wait_for(lambda: browser.execute_script(COLOUR) > 60)
        told.signal(signal.SIGSTOP)
        try:
            assert 1.0 < waits(browser, WORDS["en"].stale) < 5.0
            assert browser.execute_script(COLOUR) < 40
            assert browser.execute_script(PRESSABLE) == 0
            first = text(browser, "stale-for")
            wait_for(lambda: text(browser, "stale-for") > first)
            bar = browser.find_element(By.ID, "stale").rect
            assert bar["width"] == browser.execute_script("return document.body.clientWidth")
            keys(browser, " ", "p")
            check(browser, "supervisor-stale")
            browser.execute_script(WALL)
            assert browser.execute_script(OLD_WALL) == [60, "hidden"]
            browser.execute_script(WALL)
        finally:
            told.signal(signal.SIGCONT)
        wait_for(lambda: not text(browser, "stale"))
        assert browser.execute_script(COLOUR) > 60
        assert browser.execute_script(PRESSABLE) > 5
        assert not told.given, "what was pressed meanwhile is not done afterwards"
        keys(browser, "p")
        wait_for(lambda: [each.order for each in told.given] == ["pause"])
        told.signal(signal.SIGKILL)  # it is started again, and the page is loaded again
        waits(browser, WORDS["en"].stale)
        wait_for(lambda: not text(browser, "stale") and text(browser, "order-start"))
        told.ends()
        shown(browser, "report-verdict", "remaining: 3 trials")
    time.sleep(3.0)  # the pages have ended: the report is no old news
    assert not text(browser, "stale")
    assert text(browser, "report-verdict")


@pytest.mark.timeout(300)
def test_the_participant_reads_in_their_language_that_the_page_waits(
    tmp_path: Path, browser: webdriver.Chrome
) -> None:
    with pages(tmp_path, "page: {language: pl}\n") as told:
        opened(browser, told.links["participant"])
        told.happens(("questionnaire.start", ASKED))
        wait_for(lambda: text(browser, "item-age"))
        field = browser.find_element(By.ID, "age-field")
        field.send_keys("3")
        told.signal(signal.SIGSTOP)
        try:
            waits(browser, WORDS["pl"].stale)
            assert browser.execute_script(PRESSABLE) == 0
            field.send_keys("4")  # what is being written stays
            check(browser, "participant-stale")
        finally:
            told.signal(signal.SIGCONT)
        wait_for(lambda: not text(browser, "stale"))
        assert field.get_property("value") == "34"
        press(browser, "submit")
        wait_for(lambda: [each.text for each in told.given if "34" in each.text])
