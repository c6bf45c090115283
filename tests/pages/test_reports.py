"""What people report as seen, from both pages in a real browser; and what neither may report."""

from pathlib import Path

import pytest
from faults.sessions import unique, wait_for
from pages.room import STUDY, a_room, photograph, press, shown, text
from pages.test_rights import ask
from selenium import webdriver

from labcrane import open_recording

pytestmark = pytest.mark.long

SCENE = """\
labcrane_scene: 1
title: somebody with a broken leg
figure:
  position: [4, 0, 0.2]
  deformity: {limbs: [left_shank]}
goals: [{position: [30, 0, 0], radius: 0.1}]
"""
STEPS = """\
      - block: {task: looking}
      - block: {task: looking}
"""
TASK = "  looking: {use: scenario, scenes: [lying.yaml], limit_s: 600, find_m: 20}\n"


@pytest.fixture(scope="module")
def protocol(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reports")
    (folder / "lying.yaml").write_text(SCENE, encoding="utf-8")
    text = STUDY.format(study=unique("reports"), steps=STEPS)
    text = text.replace("sessions:\n", f"{TASK}sessions:\n").replace("title: Pages", PAGE)
    (folder / "study.yaml").write_text(text, encoding="utf-8")
    return folder / "study.yaml"


PAGE = "title: Pages\npage: {language: de}"


def test_a_deformity_is_reported_from_either_page_and_nothing_else_is(
    protocol: Path, tmp_path: Path, browser: webdriver.Chrome
) -> None:
    data = tmp_path / "data"
    with a_room(protocol, data) as room:
        wait_for(lambda: room.process("pages"))
        links = room.links()
        browser.get(links["supervisor"])
        shown(browser, "stage", "waits to start")
        supervisor = browser.current_window_handle
        cookie = "; ".join(f"{each['name']}={each['value']}" for each in browser.get_cookies())
        browser.switch_to.new_window("tab")
        participant = browser.current_window_handle
        browser.get(links["participant"])
        shown(browser, "wait", "Bitte warten")
        assert not text(browser, "report-deformity"), "no trial runs"

        # In the first trial, the operator; what no task asks about is refused in the record.
        browser.switch_to.window(supervisor)
        press(browser, "order-start")
        shown(browser, "stage", "trial")
        assert ask(room, "POST", "/orders/report", cookie, "fire")[0] == 202
        shown(browser, "events", "this task asks for reports of deformity")
        browser.switch_to.window(participant)
        shown(browser, "report-deformity", "Ich sehe: Verformung")
        press(browser, "report-deformity")
        shown(browser, "reported", "Verformung: gemeldet")
        photograph(browser, "reports")
        browser.refresh()
        shown(browser, "reported", "Verformung: gemeldet")
        browser.switch_to.window(supervisor)
        shown(browser, "events", '"by": "operator"')
        press(browser, "order-skip")

        # In the second, the supervisor.
        shown(browser, "stage", "waits to start")
        press(browser, "order-start")
        shown(browser, "stage", "trial")
        press(browser, "report-deformity")
        shown(browser, "reported", "deformity: reported")
        shown(browser, "events", '"by": "supervisor", "limb"')
        photograph(browser, "reports-supervisor")
        press(browser, "order-end")
        press(browser, "order-end-sure")
        room.ended()
    session = open_recording(data / "P001-PILOT" / "P001-PILOT.h5").session(1)
    events = session.events
    found = events[events["name"] == "deformity.found"]["data"].tolist()
    assert [(each["by"], each["limb"]) for each in found] == [
        ("operator", "left_shank"),
        ("supervisor", "left_shank"),
    ]
    told = events[events["name"] == "order.report"]["data"].tolist()
    assert [(each["by"], each["text"], each["refused"]) for each in told] == [
        ("supervisor", "fire", "this task asks for reports of deformity"),
        ("participant", "deformity", None),
        ("supervisor", "deformity", None),
    ]
