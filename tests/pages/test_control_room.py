"""The supervisor's control room in a browser: every state, its keys, and its sliders."""

from pathlib import Path

import pytest
from faults.sessions import unique, wait_for
from pages.looks import check
from pages.room import STUDY, a_room, photograph, press, shown, text
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from labcrane import open_recording

STEPS = """\
      - instructions: wait.txt
      - questionnaire: [subjective_accuracy]
      - break: {seconds: 300}
      - block: {task: aiming, pairs: 1, repeat: 20, feedback: [ball]}
"""
CUE = "feedback:\n  ball: {use: sphere, at: target, far: 4.0}\n"
SET = """
const field = document.getElementById(arguments[0]);
field.value = arguments[1];
field.dispatchEvent(new Event('change'));
"""
NAMED = """
const found = {};
window['scene_' + document.querySelector('.nicegui-scene').id].traverse(o => {
    if (o.name) found[o.name] = [o.visible, o.scale.x];
});
return found;
"""


def keys(browser: webdriver.Chrome, *pressed: str) -> None:
    """Press keys while no field has the focus, and then in whatever has it."""
    browser.execute_script("document.activeElement.blur()")
    webdriver.ActionChains(browser).send_keys(*pressed).perform()


def focused(browser: webdriver.Chrome) -> str:
    return str(browser.switch_to.active_element.get_attribute("id"))


def confirm(browser: webdriver.Chrome) -> None:
    """Confirm the question that is open: its dangerous button is reached, and Enter presses it."""
    wait_for(lambda: focused(browser) == "sure-not")
    chain = webdriver.ActionChains(browser).key_down(Keys.SHIFT).send_keys(Keys.TAB)
    chain.key_up(Keys.SHIFT).send_keys(Keys.ENTER).perform()


def never_by_space(browser: webdriver.Chrome, key: str) -> None:
    """Press Space on both buttons of the question that is open, and ask it again."""
    asks = browser.find_element(By.ID, "sure-asks")
    wait_for(lambda: focused(browser) == "sure-not")
    chain = webdriver.ActionChains(browser).key_down(Keys.SHIFT).send_keys(Keys.TAB)
    chain.key_up(Keys.SHIFT).send_keys(Keys.SPACE, Keys.SPACE).perform()
    assert focused(browser).endswith("-sure")
    assert asks.is_displayed(), "the dangerous button does not take Space"
    webdriver.ActionChains(browser).send_keys(Keys.TAB, Keys.SPACE).perform()
    wait_for(lambda: not asks.is_displayed())
    keys(browser, key)
    wait_for(asks.is_displayed)


@pytest.mark.long
def test_a_session_is_led_by_keys_alone_and_every_state_is_for_everybody(  # noqa: PLR0915 - a visit
    tmp_path: Path, browser: webdriver.Chrome
) -> None:
    protocol = tmp_path / "study.yaml"
    (tmp_path / "wait.txt").write_text("Please wait.\n")
    protocol.write_text(STUDY.format(study=unique("control"), steps=STEPS) + CUE)
    with a_room(protocol, tmp_path / "data") as room:
        wait_for(lambda: room.process("pages"))
        browser.get(room.links()["supervisor"])
        shown(browser, "instructions", "Please wait.")
        shown(browser, "order-start", "They have read it: go on")
        check(browser, "waiting")
        keys(browser, "?")
        shown(browser, "keys-title", "Keys")
        check(browser, "keys")
        keys(browser, Keys.ESCAPE)
        keys(browser, Keys.SPACE)
        wait_for(lambda: browser.find_elements(By.ID, "rating-8"))
        wait_for(lambda: not text(browser, "instructions"))
        shown(browser, "now", "Questionnaire")
        check(browser, "questionnaire")
        keys(browser, "s")
        shown(browser, "sure-asks", "Skip this trial, break or questionnaire?")
        check(browser, "a question before skipping")
        never_by_space(browser, "s")
        confirm(browser)
        shown(browser, "now", "Break")
        check(browser, "break")
        keys(browser, "s")
        shown(browser, "sure-asks", "Skip")
        confirm(browser)
        shown(browser, "stage", "ready to start: aiming")
        keys(browser, Keys.SPACE)
        shown(browser, "stage", "trial")
        wait_for(lambda: browser.execute_script(NAMED).get("target"))
        check(browser, "running")
        photograph(browser, "running")

        # A slider changes what is drawn, and the record says so.
        keys(browser, "f")
        wait_for(lambda: browser.execute_script(NAMED).get("sphere"))
        browser.execute_script(SET, "setting-ball-smallest", "0.36")
        shown(browser, "events", "Ball.smallest was set to 0.36")
        shown(browser, "now-ball-smallest", "0.36 m")
        browser.execute_script(SET, "setting-ball-largest", "0.36")
        shown(browser, "events", "Ball.largest was set to 0.36")
        wait_for(lambda: browser.execute_script(NAMED)["sphere"][1] == pytest.approx(0.36))
        browser.execute_script(SET, "setting-ball-largest", "0.1")
        shown(browser, "events", "was refused")
        keys(browser, "d")
        check(browser, "dark")
        photograph(browser, "dark")
        keys(browser, "d")
        keys(browser, "p")
        shown(browser, "now", "Paused")
        check(browser, "paused")
        keys(browser, "n", "coughs", Keys.ENTER)
        shown(browser, "events", "Note: coughs")
        wait_for(lambda: browser.find_element(By.ID, "note-field").get_property("value") == "")
        keys(browser, "h", "slower", Keys.ENTER)
        shown(browser, "events", "Hint to the operator: slower")
        keys(browser, Keys.SPACE)
        shown(browser, "stage", "trial")
        keys(browser, "r")
        shown(browser, "now", "attempt 2")
        keys(browser, "o")
        shown(browser, "events", "Override was requested")
        keys(browser, "c")
        shown(browser, "events", "Completion 1 was requested")
        keys(browser, "x")
        shown(browser, "events", "Completion 0 was requested")
        keys(browser, "f")
        wait_for(lambda: browser.switch_to.active_element.get_attribute("id") == "setting-ball-at")
        keys(browser, "e")
        shown(browser, "sure-asks", "End the session now?")
        never_by_space(browser, "e")
        confirm(browser)
        shown(browser, "report-verdict", "The session is saved")
        check(browser, "ended")
        press(browser, "close-page")
        room.ended()
    session = open_recording(room.folder / "P001-PILOT.h5").session(1)
    events = session.events
    changed = events[events["name"] == "feedback.setting"]["data"]
    assert [(each["feedback"], each["key"], each["value"]) for each in changed] == [
        ("ball", "smallest", 0.36), ("ball", "largest", 0.36),
    ]  # fmt: skip
