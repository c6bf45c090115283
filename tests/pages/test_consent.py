"""Consent is given on the participant's page, to the text that was approved."""

import signal
from pathlib import Path

import pytest
from faults.sessions import unique, wait_for
from governed import GOVERNED, Lab
from pages.room import a_room, photograph, press, shown, text
from selenium import webdriver

from labcrane import open_recording
from labcrane.approval.lock import read_lock
from labcrane.cli.consent import await_consent
from labcrane.participants.register import read
from labcrane.testing import QueueConsole

FETCH = "const done = arguments[0]; fetch('/consent').then(r => r.text()).then(done);"


@pytest.mark.slow
def test_the_session_begins_once_the_participant_has_consented_on_the_page(
    tmp_path: Path, browser: webdriver.Chrome
) -> None:
    lab = Lab(tmp_path, GOVERNED.replace("rehearsal", unique("consent")))
    lab.approve()
    version = read_lock(lab.protocol).consent_version
    with a_room(lab.protocol, lab.places.root, pilot=False) as room:
        wait_for(lambda: room.process("pages"))
        browser.get(room.links()["participant"])
        shown(browser, "consent-version", f"consent_v2.txt, version {version}")
        assert "I can stop at any time." in text(browser, "consent")
        approved = (lab.folder / "consent_v2.txt").read_text()
        assert browser.execute_async_script(FETCH) == approved
        photograph(browser, "consent")
        assert "P001" not in read(lab.places).participants
        assert not room.folder.exists()
        press(browser, "order-consent")
        shown(browser, "wait", "Please wait")
        wait_for(lambda: "space to start" in "".join(room.said))
        assert text(browser, "consent") == ""
        assert browser.execute_async_script(FETCH) == "no consent is asked for"
        room.launcher.send_signal(signal.SIGINT)
        room.ended()
    (consent,) = read(lab.places).participants["P001"].consent
    assert (consent.version, consent.by) == (version, "participant")
    session = open_recording(room.folder / "P001.h5").session(1)
    assert session.attrs["consent_version"] == version
    assert session.attrs["consent_by"] == "participant"


@pytest.mark.slow
def test_a_run_that_is_ended_instead_leaves_nobody_in_the_register(tmp_path: Path) -> None:
    lab = Lab(tmp_path, GOVERNED.replace("rehearsal", unique("consent")))
    lab.approve()
    with a_room(lab.protocol, lab.places.root, pilot=False) as room:
        wait_for(lambda: "waiting for P001's consent" in "".join(room.said))
        room.launcher.send_signal(signal.SIGINT)
        assert room.launcher.wait(240) == 2
        wait_for(lambda: "P001 has not consented to consent_v2.txt" in "".join(room.said))
    assert not lab.places.register.exists()


def test_an_interrupt_that_comes_while_consent_is_being_asked_for_ends_the_asking(
    tmp_path: Path,
) -> None:
    lab = Lab(tmp_path)
    lab.approve()

    def interrupted(words: str) -> None:
        asked.append(words)
        raise KeyboardInterrupt

    asked: list[str] = []
    await_consent(lab.visit("P001"), QueueConsole(), interrupted)
    assert len(asked) == 1
    assert not lab.places.register.exists()
