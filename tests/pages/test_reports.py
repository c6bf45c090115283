"""What people report as seen, from both pages in a real browser; and what neither may report."""

import shutil
from pathlib import Path

import pytest
from cranes import needs_bullet
from dmd_arms import RETRIEVAL
from faults.sessions import unique, wait_for
from pages.room import a_room, photograph, press, shown
from pages.test_rights import ask
from selenium import webdriver
from selenium.webdriver.common.by import By

from labcrane import open_recording

pytestmark = [needs_bullet, pytest.mark.long]

SCENE = """\
labcrane_scene: 1
title: somebody with a broken leg
figure:
  position: [4, 0, 0.2]
  deformity: {limbs: [left_shank]}
goals: [{position: [30, 0, 0], radius: 0.1}]
"""
STUDY = """\
labcrane: 1
study: {study}
title: Somebody with a broken leg
page: {{language: de}}
rate_hz: 240
machine: ied_arm.yaml
input: {{use: scenario_operator}}
operator: {{use: scenario_operator}}
scheme: {{use: valve, model: arm.dmd.yaml}}
dynamics:
  {{use: dmd_arm, model: arm.dmd.yaml, proportional: [base], jaws: {{}}, scenes: [lying.yaml]}}
tasks:
  looking: {{use: scenario, scenes: [lying.yaml], limit_s: 600, find_m: 20}}
sessions:
  - name: only
    steps:
      - block: {{task: looking}}
      - block: {{task: looking}}
"""


@pytest.fixture(scope="module")
def protocol(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reports")
    for name in ("ied_arm.yaml", "arm.dmd.yaml"):
        shutil.copy(RETRIEVAL / name, folder)
    (folder / "lying.yaml").write_text(SCENE, encoding="utf-8")
    (folder / "study.yaml").write_text(STUDY.format(study=unique("reports")), encoding="utf-8")
    return folder / "study.yaml"


def test_a_deformity_is_reported_from_either_page_and_nothing_else_is(
    protocol: Path, tmp_path: Path, browser: webdriver.Chrome
) -> None:
    data = tmp_path / "data"
    with a_room(protocol, data) as room:
        wait_for(lambda: room.process("pages"))
        links = room.links()
        browser.get(links["supervisor"])
        shown(browser, "stage", "ready to start")
        supervisor = browser.current_window_handle
        cookie = "; ".join(f"{each['name']}={each['value']}" for each in browser.get_cookies())
        browser.switch_to.new_window("tab")
        participant = browser.current_window_handle
        browser.get(links["participant"])
        shown(browser, "wait", "Bitte warten")
        button = browser.find_element(By.ID, "report-deformity")
        assert not button.is_displayed(), "no trial runs"

        # In the first trial, the operator; what no task asks about is refused in the record.
        browser.switch_to.window(supervisor)
        browser.refresh()  # a window in the background is not kept up to date
        press(browser, "order-start")
        shown(browser, "stage", "trial")
        # The test as it stands, while it runs.
        shown(browser, "performance", "test in lying, running")
        shown(browser, "performance", "no indicator: this scenario has no reference time")
        assert ask(room, "POST", "/orders/report", cookie, "fire")[0] == 202
        shown(browser, "events", "this task asks for reports of deformity")
        browser.switch_to.window(participant)
        browser.refresh()
        shown(browser, "report-deformity", "Ich sehe: Verformung")
        press(browser, "report-deformity")
        shown(browser, "reported", "Verformung: gemeldet")
        photograph(browser, "reports")
        browser.refresh()
        shown(browser, "reported", "Verformung: gemeldet")
        browser.switch_to.window(supervisor)
        browser.refresh()  # a window in the background is not kept up to date
        shown(browser, "events", "by operator")
        press(browser, "order-skip")
        press(browser, "order-skip-sure")

        # In the second, the supervisor.
        shown(browser, "stage", "ready to start")
        press(browser, "order-start")
        shown(browser, "stage", "trial")
        press(browser, "report-deformity")
        shown(browser, "reported", "deformity: reported")
        shown(browser, "events", "by supervisor, limb")
        photograph(browser, "reports-supervisor")
        press(browser, "order-end")
        press(browser, "order-end-sure")
        press(browser, "close-page")
        room.ended()
    check_the_record(data)


def check_the_record(data: Path) -> None:
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
