"""A session of a person from the start page: killed, resumed to its end, and its results."""

import os
import subprocess
import time
from pathlib import Path

import psutil
import pytest
from faults.sessions import wait_for
from needs import GRAPHICS, need
from pages.room import text
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select
from start.test_page import PRESS, REPLACE, Page, browser, lab  # noqa: F401 - fixtures
from start.test_workspace import served
from windows import an_x_server

import labcrane

pytestmark = [pytest.mark.long]

SHORTER = (("distances: [2, 4]", "distances: [2]"), ("movements: 4", "movements: 1"),
           ("limit_s: 30", "limit_s: 2"), ("seconds: 120", "seconds: 2"))  # fmt: skip
ANSWER_ALL = """
for (const item of document.querySelectorAll('.form-item')) {
  item.querySelector(`[id^=decline]`)?.click();
}
"""


class Person:
    """Experimenter and participant of a session, at their pages, and the operator's keys."""

    def __init__(self, page: Page, display: str) -> None:
        self.page, self.browser = page, page.browser
        self.here = page.browser.current_window_handle
        self.environment = {**os.environ, "DISPLAY": display}

    def log(self) -> str:
        return text(self.browser, "log")

    def task(self, word: str) -> None:
        before = self._jobs()
        self.page.press(f"main [data-place={word}]")
        wait_for(lambda: self.page.browser.find_elements(
            By.CSS_SELECTOR, f"[data-place={word}][aria-pressed=true]"))  # fmt: skip
        self.page.press("start")
        wait_for(lambda: self._jobs() > before)

    def _jobs(self) -> int:
        numbered = "//*[@id='jobs']//button[@aria-pressed]"
        return len(self.browser.find_elements(By.XPATH, numbered))

    def do(self, word: str) -> None:
        """Do a task that ends by itself."""
        self.task(word)
        wait_for(lambda: text(self.browser, "status") == "Done")

    def open(self) -> None:
        """Open the pages of the session that runs."""
        wait_for(lambda: len(self.browser.find_elements(By.CSS_SELECTOR, "#links a")) == 2)
        links = [
            each.get_attribute("href")
            for each in self.browser.find_elements(By.CSS_SELECTOR, "#links a")
        ]
        self.tabs = []
        for link in links:
            self.browser.switch_to.new_window("tab")
            self.browser.get(link)
            self.tabs.append(self.browser.current_window_handle)
        self.browser.switch_to.window(self.here)

    def close(self) -> None:
        for tab in self.tabs:
            self.browser.switch_to.window(tab)
            self.browser.close()
        self.browser.switch_to.window(self.here)

    def until(self, words: str, patience_s: float = 240.0) -> None:
        """Start each step, answer each questionnaire and press keys until the output has words."""
        ends = time.monotonic() + patience_s
        while words not in self.log():
            assert time.monotonic() < ends, self.log()
            assert text(self.browser, "status") == "Running", self.log()
            for tab, does in zip(self.tabs, (self._start, self._answer), strict=True):
                self.browser.switch_to.window(tab)
                does()
            self.browser.switch_to.window(self.here)
            self._key()

    def _key(self) -> None:
        keys = ["search", "--name", "^labcrane: operator", "windowfocus", "keydown", "d"]
        for words in (keys, ["sleep", "0.2", "keyup", "d"]):
            subprocess.run(["xdotool", *words], env=self.environment, check=False)

    def _start(self) -> None:
        self.browser.execute_script(PRESS, "#order-start:not(:disabled)")

    def _answer(self) -> None:
        self.browser.execute_script(ANSWER_ALL)
        time.sleep(0.5)  # each answer comes back from the record first
        self.browser.execute_script(PRESS, "#submit")


def test_a_session_is_killed_resumed_and_reported_without_a_terminal(
    lab: Path,  # noqa: F811 - a fixture
    browser: webdriver.Chrome,  # noqa: F811 - a fixture
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    need("xdotool", *GRAPHICS)
    with an_x_server() as display:
        monkeypatch.setenv("DISPLAY", display)
        with served(lab) as (server, link):
            page = Page(browser, link)
            Select(browser.find_element(By.ID, "shipped")).select_by_visible_text("whole")
            page.press("copy")
            page.is_fine()
            Select(browser.find_element(By.ID, "file")).select_by_visible_text("keyboard.yaml")
            wait_for(lambda: text(browser, "title") == "keyboard.yaml")
            page.is_fine()
            short = page.yaml()
            for long, shorter in SHORTER:
                assert long in short
                short = short.replace(long, shorter)
            browser.execute_script(REPLACE, short)
            wait_for(lambda: "not saved" in text(browser, "state"))
            page.press("tab-do")
            person = Person(page, display)
            person.task("pilot")
            person.open()
            person.until("trial 1 of")
            for each in psutil.Process(server.pid).children(recursive=True):
                each.kill()
            wait_for(lambda: "Ended with status" in text(browser, "status"))
            person.close()
            person.task("go_on")
            person.open()
            person.until("shows what was saved until you close it")
            browser.switch_to.window(person.tabs[0])
            wait_for(lambda: browser.execute_script(PRESS, "#close-page"))
            browser.switch_to.window(person.here)
            wait_for(lambda: text(browser, "status") == "Done")
            person.close()
            folder = lab / "my_study" / "data" / "P001-PILOT"
            recorded = labcrane.open_recording(folder / "P001-PILOT.h5").session(1)
            assert (recorded.trials.practice == 0).sum() == 2 * 2, "two pairs in each block"
            slew = recorded.streams["state"].data["joint.angle.slew"]
            assert slew.max() - slew.min() > 0.01, "the keys moved the crane"
            _results(person, lab / "my_study")


def _results(person: Person, study: Path) -> None:
    page, chromium = person.page, person.browser
    person.task("overview")
    wait_for(lambda: chromium.find_elements(By.CSS_SELECTOR, "#links a"))
    link = chromium.find_element(By.CSS_SELECTOR, "#links a").get_attribute("href")
    chromium.switch_to.new_window("tab")
    chromium.get(link)
    wait_for(lambda: "P001" in chromium.find_element(By.TAG_NAME, "body").text)
    chromium.close()
    chromium.switch_to.window(person.here)
    page.press("stop")
    person.do("report")
    assert chromium.find_element(By.CSS_SELECTOR, "#reports button").text == (
        "Open pilot-report/report.html"
    )
    assert (study / "pilot-report" / "report.html").stat().st_size > 10_000
    person.do("tables")
    assert list((study / "tables").rglob("*trials*"))
