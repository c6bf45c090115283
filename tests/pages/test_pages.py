"""Both pages in a real browser: orders, answers, reloads, and processes that are killed."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from faults.sessions import unique, wait_for
from pages.room import STUDY, a_room, photograph, press, shown, text, write
from selenium import webdriver
from selenium.webdriver.common.by import By

from labcrane import open_recording
from labcrane.testing import main

STEPS = """\
      - questionnaire: [demographics, subjective_accuracy]
      - block: {task: aiming, pairs: 1, repeat: 20}
"""


@pytest.fixture(scope="module")
def protocol(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pages") / "study.yaml"
    path.write_text(STUDY.format(study=unique("pages"), steps=STEPS))
    return path


def addresses(browser) -> set[str]:
    """Return the hosts of everything that the browser has asked for."""
    found = set()
    for entry in browser.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] in {"Network.requestWillBeSent", "Network.webSocketCreated"}:
            params = message["params"]
            url = params.get("url") or params["request"]["url"]
            if not url.startswith(("data:", "blob:", "chrome:")):
                found.add(url.split("/")[2].partition(":")[0])
    return found


@pytest.mark.long
def test_a_session_is_led_and_answered_from_a_browser(  # noqa: PLR0915 - one visit, in order
    protocol: Path, tmp_path: Path, browser: webdriver.Chrome
) -> None:
    data = tmp_path / "data"
    with a_room(protocol, data) as room:
        wait_for(lambda: room.process("pages"))
        links = room.links()
        browser.get(links["supervisor"])
        assert "token" not in browser.current_url
        shown(browser, "stage", "questionnaire: About you")
        supervisor = browser.current_window_handle
        browser.switch_to.new_window("tab")
        participant = browser.current_window_handle
        browser.get(links["participant"])

        # A wrong answer, a right one, and a reload in the middle.
        write(browser, "age-field", "7")
        shown(browser, "refusal", "Possible is 16 to 99 in steps of 1")
        assert text(browser, "status-age").startswith("not accepted")
        write(browser, "age-field", "31")
        shown(browser, "status-age", "saved")
        press(browser, "sex-female")
        shown(browser, "status-sex", "saved")
        photograph(browser, "participant")
        browser.refresh()
        shown(browser, "status-sex", "saved")
        assert browser.find_element(By.ID, "age-field").get_property("value") == "31"
        assert browser.find_element(By.ID, "sex-female").get_attribute("aria-pressed") == "true"

        # The pages' process is killed: it comes back, and so does every answer.
        room.process("pages").kill()
        wait_for(lambda: "the page crashed and was restarted" in "".join(room.said))
        wait_for(lambda: room.process("pages"))
        browser.refresh()
        shown(browser, "status-age", "saved")
        shown(browser, "status-sex", "saved")
        press(browser, "submit")
        shown(browser, "refusal", "Some answers are missing")
        press(browser, "handedness-left")
        write(browser, "experience-field", "2.5")
        write(browser, "gaming-field", "0")
        shown(browser, "status-gaming", "saved")
        press(browser, "submit")
        press(browser, "rating-8")
        shown(browser, "status-rating", "saved")
        press(browser, "submit")
        shown(browser, "wait", "Please wait")

        browser.switch_to.window(supervisor)
        browser.refresh()
        shown(browser, "stage", "ready to start: aiming")
        press(browser, "order-start")
        shown(browser, "stage", "trial")
        press(browser, "order-pause")
        shown(browser, "stage", "paused by you")
        photograph(browser, "supervisor")
        write(browser, "note-field", "coughs")
        shown(browser, "events", "Note: coughs")
        write(browser, "hint-field", "slower")
        shown(browser, "events", "Hint to the operator: slower")
        press(browser, "order-start")
        press(browser, "order-override")
        shown(browser, "events", "Override was requested by experimenter")
        press(browser, "order-completion1")
        shown(browser, "events", "Completion 1 was requested")
        press(browser, "order-repeat")
        shown(browser, "now", "attempt 2")
        press(browser, "order-skip")
        press(browser, "order-skip-sure")
        shown(browser, "events", "Skip was requested")
        press(browser, "order-end")
        press(browser, "order-end-sure")
        shown(browser, "report-verdict", "The session is saved")
        browser.refresh()
        shown(browser, "report-verdict", "The session is saved")
        assert "P001-PILOT.h5" in text(browser, "saved")
        photograph(browser, "ended")
        assert room.launcher.poll() is None, "the end stays until it is closed"
        press(browser, "close-page")
        browser.switch_to.window(participant)
        room.ended()
        assert addresses(browser) == {"127.0.0.1"}
    check_record(data)


def check_record(data: Path) -> None:
    file = data / "P001-PILOT" / "P001-PILOT.h5"
    assert main(["replay", str(file), "--session", "1"]) == 0, (
        "the orders of pages are replayed too"
    )
    session = open_recording(file).session(1)
    table = session.questionnaires
    answers = table[table["kind"] == "answer"].set_index("item")
    assert answers.loc["age", "value"] == 31.0
    assert answers.loc["sex", "text"] == "female"
    assert answers.loc["experience", "value"] == 2.5
    scores = table[table["kind"] == "score"]
    assert scores[["questionnaire", "item", "value"]].to_numpy().tolist() == [
        ["subjective_accuracy", "share", 0.8]
    ]
    orders = session.events[session.events["name"].str.startswith("order.")]
    given = {
        name.removeprefix("order."): d
        for name, d in zip(orders["name"], orders["data"], strict=True)
    }
    assert set(given) == {
        "start", "pause", "note", "hint", "override", "completion", "repeat", "skip", "end",
    }  # fmt: skip
    ends = session.events[session.events["name"] == "trial.end"]["data"]
    assert [data["outcome"] for data in ends][:2] == ["repeated", "skipped"]
    assert all(d["by"] == "supervisor" and d["refused"] is None for d in given.values())


@pytest.mark.slow
def test_the_pages_end_without_a_complaint_of_pythons(tmp_path: Path) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(STUDY.format(study=unique("ends"), steps="      - break: {seconds: 300}\n"))
    with a_room(path, tmp_path / "data") as room:
        wait_for(lambda: room.process("pages"))
        room.process("session").kill()
        assert room.launcher.wait(240) == 1
    said = "".join(room.said)
    assert "participant file: " in said
    assert not re.search("leaked|Traceback", said), said


@pytest.mark.long
def test_no_answer_is_lost_when_the_session_is_killed_in_the_middle(
    protocol: Path, tmp_path: Path, browser: webdriver.Chrome
) -> None:
    data = tmp_path / "data"
    with a_room(protocol, data) as room:
        wait_for(lambda: room.process("pages"))
        browser.get(room.links()["participant"])
        write(browser, "age-field", "44")
        shown(browser, "status-age", "saved")
        room.process("session").kill()
        assert room.launcher.wait(240) == 1
    table = open_recording(data / "P001-PILOT" / "P001-PILOT.h5").session(1).questionnaires
    assert table[["item", "value"]].to_numpy().tolist() == [["age", 44.0]]
    with a_room(protocol, data, "resume") as room:
        wait_for(lambda: room.process("pages"))
        browser.get(room.links()["participant"])
        shown(browser, "status-age", "saved")
        assert browser.find_element(By.ID, "age-field").get_property("value") == "44"
        for item in ("sex-male", "handedness-right"):
            press(browser, item)
        write(browser, "experience-field", "0")
        write(browser, "gaming-field", "1")
        shown(browser, "status-gaming", "saved")
        press(browser, "submit")
        wait_for(lambda: browser.find_elements(By.ID, "rating-3"))
        room.process("session").kill()
        assert room.launcher.wait(240) == 1
    events = open_recording(data / "P001-PILOT" / "P001-PILOT.h5").session(1).events
    [done] = events[events["name"] == "questionnaire.end"]["data"]
    assert (done["questionnaire"], done["missing"]) == ("demographics", 0)


READING = """\
import importlib, runpy, sys, threading
import h5py
from h5py._objects import phil

service = importlib.import_module("labcrane.web.service")
held = threading.Event()

def read():
    with phil:  # as while a recording is read
        held.set()
        threading.Event().wait()

def main():
    threading.Thread(target=read, daemon=True).start()
    held.wait()
    return 3

service.main = main
opened = h5py.File(sys.argv[1], "w")
runpy.run_module("labcrane.web.service", run_name="__main__")
"""


def test_the_pages_end_while_a_recording_is_being_read(tmp_path: Path) -> None:
    words = [sys.executable, "-W", "ignore", "-c", READING, str(tmp_path / "being_read.h5")]
    assert subprocess.run(words, timeout=240, check=False).returncode == 3
