"""Every state of both pages in a browser: for everybody by WCAG AA, nothing cut at three sizes."""

import json
import math
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from faults.sessions import unique, wait_for
from pages.looks import check
from pages.room import STUDY, press, shown, text
from pages.test_control_room import keys
from selenium import webdriver
from selenium.common.exceptions import WebDriverException
from selenium.webdriver.common.by import By

from labcrane.core import Event
from labcrane.testing import Command
from labcrane.web.control_room.condition import STATES
from labcrane.web.handle import PageHandle, free_port
from labcrane.web.service import PageConfig
from labcrane.web.state import SessionLeft
from labcrane.web.translations import WORDS

pytestmark = pytest.mark.long

STEPS = "      - block: {task: aiming, pairs: 1, repeat: 20, feedback: [ball]}\n"
MORE = """\
feedback:
  ball: {use: sphere, at: target, far: 4.0}
questionnaires:
  person: {use: demographics}
  load: {use: nasa_tlx}
"""
CONSENT = {
    "file": "consent_v2.txt", "version": "0123456789ab",
    "text": "I take part.\nI can stop at any time.\n" * 20,
}  # fmt: skip
TRIAL = {"trial": 1, "attempt": 1, "counted": True, "feedback": "ball"}
CAB = {"what": "cab", "why": "no driver", "left_out": True, "attempt": 0, "attempts": 3}
STOPPED = {
    "questionnaire": "load", "score": "overall", "value": 90.0, "above": 80.0,
}  # fmt: skip
ASKED = {"questionnaire": "person", "title": "About you", "kept": "{}"}
ENDED = SessionLeft(
    "warn", "The session is saved but incomplete; check its timestamps; remaining: 3 trials",
    "to continue, run: labcrane resume study.yaml --participant P001 --session 1",
    ("participant file: data/P001/P001.h5 (12.3 MB)", "journal: data/P001/ses-01_run.xdf"),
    ("stream", "verdict", "uncertainty"), (("EEG", "WARN", "1.4 ms"), ("loop", "PASS", "0 ms")),
    ("EEG: move the computers into one network",),
)  # fmt: skip


class Told:
    """A page process that is told what a session would tell it."""

    def __init__(self, protocol: Path) -> None:
        self.order = PageConfig(
            protocol, "P001", "P001", 1, unique("states"), "127.0.0.1", free_port("127.0.0.1", 0)
        )
        self.given: list[Command] = []
        self._handle = PageHandle(self.order, self.given.append, lambda _: None, dict)
        self.links = self._handle.links()

    def happens(self, *events: tuple[str, dict]) -> None:
        for name, data in events:
            self._handle.tell(Event(name, time.perf_counter(), data))

    def signal(self, number: int) -> None:
        """Send a signal to the pages' process."""
        os.kill(self._handle._process.pid, number)

    def ends(self) -> None:
        from threading import Thread

        self._closing = Thread(target=self._handle.close, args=(ENDED,))
        self._closing.start()

    def stop(self) -> None:
        if not hasattr(self, "_closing"):
            self.ends()
        self._handle._closed.set()
        self._closing.join(60)


@contextmanager
def pages(folder: Path, own: str = "") -> Iterator[Told]:
    protocol = folder / "study.yaml"
    protocol.write_text(STUDY.format(study=unique("states"), steps=STEPS) + MORE + own)
    told = Told(protocol)
    try:
        yield told
    finally:
        told.stop()


def opened(browser: webdriver.Chrome, link: str) -> None:
    def there() -> bool:
        try:
            browser.get(link)
        except WebDriverException:
            return False
        return bool(browser.find_elements(By.CSS_SELECTOR, ".room, .form-page"))

    wait_for(there)


BEGUN: dict[str, tuple[tuple[str, dict], ...]] = {
    "starting": (),
    "consent": (("consent.needed", CONSENT),),
    "waiting": (("consent.given", {"by": "examiner"}), ("waiting", {"what": "aim"})),
    "running": (("trial.start", TRIAL), ("note", {"text": "coughs", "by": "supervisor"})),
    "paused": (("pause.start", {"by": "examiner"}),),
    "fault": (
        ("pause.end", {"by": "examiner"}),
        ("input.lost", {"what": "left", "why": "the joystick was unplugged"}),
        ("pause.start", {"by": "input"}),
        ("feedback.lost", CAB),
    ),
    "decision": (
        ("feedback.ready", {"what": "cab", "facts": ""}),
        ("input.back", {"what": "left"}), ("pause.end", {"by": "input"}),
        ("stop_rule.met", STOPPED), ("pause.start", {"by": "stop rule"}),
    ),
    "between": (
        ("pause.end", {"by": "stop rule"}),
        ("trial.end", {**TRIAL, "outcome": "success"}), ("step.end", {"step": 1, "done": True}),
    ),
    "judgement": (("judgement.awaited", {"trial": 1, "attempt": 1}),),
    "break": (("break.start", {"seconds": 300}),),
    "fixation": (("fixation.shown", {"point": 2, "x": 0.15, "y": 0.15}),),
    "questionnaire": (("break.end", {"left": 0.0}), ("questionnaire.start", ASKED)),
    "ended": (
        ("questionnaire.end", {"questionnaire": "person"}),
        ("session.end", {"reason": "ended", "owed": "3 trials"}),
    ),
}  # fmt: skip
PLACES = """
scrollTo(0, 0);
return [...document.querySelectorAll('.room-actions button')].map(e => {
    const {x, y, width, height} = e.getBoundingClientRect();
    return [e.id, x, y, width, height];
});
"""
ARCMIN = math.degrees(0.277 / 3000.0) * 60.0
"""Of a pixel of a display of 24 inches (1920 pixels on 531 mm) from 3 m; 16 are needed to read."""

SMALLEST = """
const walk = document.createTreeWalker(document.querySelector('.room'), NodeFilter.SHOW_TEXT);
let least = Infinity;
while (walk.nextNode()) {
    const e = walk.currentNode.parentElement;
    if (walk.currentNode.textContent.trim() && e.checkVisibility())
        least = Math.min(least, parseFloat(getComputedStyle(e).fontSize));
}
return least;
"""
"""The size of the smallest letters on the page, in pixels."""

STATE = "return document.querySelector('.room')?.dataset.state"


@pytest.mark.timeout(900)
def test_every_state_of_the_control_room_is_for_everybody(
    tmp_path: Path, browser: webdriver.Chrome
) -> None:
    assert set(BEGUN) == set(STATES)
    places = []
    with pages(tmp_path) as told:
        opened(browser, told.links["supervisor"])
        for state, events in BEGUN.items():
            told.happens(*events)
            wait_for(lambda state=state: browser.execute_script(STATE) == state)
            if state != "ended":
                places.append(browser.execute_script(PLACES))
                assert places[0] == places[-1], f"no button moves in state {state}"
            if state == "fault":
                shown(browser, "lamp", "left")
                assert text(browser, "remedy"), "what to do is said"
                assert "has given up after 3 attempts" in text(browser, "fault-feedback-cab")
                assert browser.find_element(By.ID, "order-start").get_attribute("title")
                for ident, order in (("again-cab", "again"), ("without-cab", "without")):
                    press(browser, ident)
                    wait_for(lambda order=order: ("cab", order) in [
                        (each.text, each.order) for each in told.given
                    ])  # fmt: skip
                assert browser.find_elements(By.ID, "end-fault-feedback-cab")
            if state == "consent":
                shown(browser, "consent-version", CONSENT["version"])
            check(browser, f"supervisor-{state}")
            keys(browser, "w")
            smallest = browser.execute_script(SMALLEST)
            assert ARCMIN * smallest >= 16.0, f"{state} is not read from 3 m"
            assert text(browser, "who").startswith("P001")
            if state == "fault":
                check(browser, "wall")
            keys(browser, "w")
        told.ends()
        shown(browser, "report-verdict", "remaining: 3 trials")
        check(browser, "supervisor-report")
        browser.refresh()
        shown(browser, "report-verdict", "remaining: 3 trials")
        press(browser, "close-page")
        shown(browser, "closed", "Close this tab")


@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    ("own", "name"),
    [("", "all"), ("page: {language: pl, one_at_a_time: true, colour: '#004d40'}\n", "one")],
)
def test_every_state_of_the_participants_page_is_for_everybody(
    own: str, name: str, tmp_path: Path, browser: webdriver.Chrome
) -> None:
    with pages(tmp_path, own) as told:
        opened(browser, told.links["participant"])
        wait_for(lambda: text(browser, "wait"))
        check(browser, f"participant-{name}-waiting")
        told.happens(("consent.needed", CONSENT))
        shown(browser, "consent-version", CONSENT["version"])
        check(browser, f"participant-{name}-consent")
        told.happens(("consent.given", {"version": "a", "by": "participant"}))
        wait_for(lambda: not text(browser, "consent"))
        told.happens(("questionnaire.start", ASKED))
        wait_for(lambda: text(browser, "item-age"))
        check(browser, f"participant-{name}-questions")
        refused = {"questionnaire": "person", "item": "age", "why": "not a number"}
        told.happens(("questionnaire.refused", refused))
        wait_for(lambda: text(browser, "status-age"))
        status = browser.find_element(By.ID, "status-age")
        assert "text-red-900" in status.get_attribute("class"), "only what is accepted is green"
        said = WORDS["pl" if own else "en"].possible.format(takes="")
        assert said in text(browser, "status-age"), "not in the record's words"
        check(browser, f"participant-{name}-refused")
        told.happens(("questionnaire.end", {"questionnaire": "person"}))
        load = {"questionnaire": "load", "title": "Load", "kept": json.dumps({})}
        told.happens(("questionnaire.start", load))
        wait_for(lambda: text(browser, "answered") and not text(browser, "item-age"))
        check(browser, f"participant-{name}-scales")
        told.happens(("questionnaire.end", {"questionnaire": "load"}))
        told.happens(("session.end", {"reason": "complete", "owed": ""}))
        thanks = WORDS["pl" if own else "en"].thanks
        shown(browser, "wait", thanks)
        check(browser, f"participant-{name}-thanks")
