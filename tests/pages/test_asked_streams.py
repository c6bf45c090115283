"""A stream of others that only its type asks for, confirmed on the supervisor's page."""

import subprocess
import sys
from pathlib import Path

import pytest
from faults.sessions import unique, wait_for
from pages.room import STUDY, a_room, press, shown
from selenium import webdriver

SENDER = Path(__file__).parents[1] / "streams" / "emulation" / "sender.py"
STEPS = "      - block: {task: aiming, pairs: 1}"

pytestmark = pytest.mark.long


def test_the_supervisor_says_with_a_button_which_stream_is_meant(
    tmp_path: Path, browser: webdriver.Chrome
) -> None:
    kind = unique("Force")
    protocol = tmp_path / "study.yaml"
    text = STUDY.format(study=unique("asked"), steps=STEPS)
    protocol.write_text(f"{text}streams: {{force: {{type: {kind}}}}}\n", encoding="utf-8")
    sender = subprocess.Popen([sys.executable, str(SENDER), "Plate", kind, "plate-1", "100", "0"])
    try:
        with a_room(protocol, tmp_path / "data") as room:
            wait_for(lambda: room.process("pages"))
            browser.get(room.links()["supervisor"])
            shown(browser, "streams", "Record 'Plate' (source_id 'plate-1') ")
            shown(browser, "take-force-0", "Use Plate on ")
            assert not room.process("session"), "it has not begun"
            press(browser, "take-force-0")
            wait_for(lambda: any("was confirmed: it is 'Plate'" in line for line in room.said))
            shown(browser, "streams", "flows")
            shown(browser, "events", "Stream force is 'Plate'")
    finally:
        sender.kill()
        sender.wait()
