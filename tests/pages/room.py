"""A run in real time with its pages, and a browser."""

import os
import re
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest
from faults.sessions import labcrane, wait_for
from needs import need
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from simple_crane import FORM

from labcrane.launcher import session_process
from labcrane.web import service
from labcrane.web.server.access import NAMES

STUDY = (
    """\
labcrane: 1
study: {study}
title: Pages
rate_hz: 240
"""
    + FORM.replace("dual_joystick", "simulated_operator")
    + """\
tasks:
  aiming: {{use: aiming, distances: [6], movements: 2, limit_s: 60}}
sessions:
  - name: only
    steps:
{steps}
"""
)


class Room:
    """A launcher with its pages; says what it has printed."""

    def __init__(
        self, protocol: Path, data: Path, what: str = "run", *, pilot: bool = True
    ) -> None:
        self.data = data
        self.folder = data / ("P001-PILOT" if pilot else "P001")
        stamp = ["--pilot"] if pilot else []
        self.launcher = labcrane(
            what, protocol, "--participant", "P001", "--data", data, *stamp, "--local",
            env={**os.environ, "PYTHONUNBUFFERED": "1", "COLUMNS": "200"},
        )  # fmt: skip
        self.said: list[str] = []
        self._reader = threading.Thread(target=self._read)
        self._reader.start()
        wait_for(lambda: len(self.links()) == 2 or self.launcher.poll() is not None)
        assert self.launcher.poll() is None, "".join(self.said)
        with socket.create_connection(("127.0.0.1", self.port), 60):
            pass  # a link is printed once it can be opened

    def _read(self) -> None:
        for line in self.launcher.stdout:
            self.said.append(line)

    def links(self) -> dict[str, str]:
        found = re.findall(r"(\w+)'s page: (https?://\S+)", "".join(self.said))
        page_of = {name: page for page, name in NAMES.items()}
        return {page_of[name]: link for name, link in found}

    def process(self, word: str) -> psutil.Process | None:
        """Return the session's process, or that of the pages once it serves them."""
        module = {"session": session_process.__name__, "pages": service.__name__}[word]
        for child in psutil.Process(self.launcher.pid).children():
            with suppress(psutil.NoSuchProcess):  # it is ending this very moment
                if module in child.cmdline() and (word == "session" or self._serves(child)):
                    return child
        return None

    def _serves(self, child: psutil.Process) -> bool:
        return any(
            each.status == "LISTEN" and each.laddr.port == self.port
            for each in child.net_connections()
        )

    @property
    def port(self) -> int:
        return int(re.search(r":(\d+)/", self.links()["supervisor"])[1])

    def ended(self, patience_s: float = 240.0) -> None:
        """See that the run ends by itself, and well."""
        try:
            code = self.launcher.wait(patience_s)
        except subprocess.TimeoutExpired:
            pytest.fail(f"the run has not ended after {patience_s:g} s: {''.join(self.said)}")
        assert code == 0, "".join(self.said)

    def end(self) -> None:
        if self.launcher.poll() is None:
            processes = [psutil.Process(self.launcher.pid)]
            processes += processes[0].children(recursive=True)
            for process in processes:
                with suppress(psutil.NoSuchProcess):  # it ends when its launcher has gone
                    process.kill()
            psutil.wait_procs(processes, timeout=240)
            self.launcher.wait()
        self._reader.join()
        self.launcher.stdout.close()


@contextmanager
def a_room(protocol: Path, data: Path, what: str = "run", *, pilot: bool = True) -> Iterator[Room]:
    room = Room(protocol, data, what, pilot=pilot)
    try:
        yield room
    finally:
        room.end()


@contextmanager
def a_browser(profile: Path) -> Iterator[webdriver.Chrome]:
    """Start Debian's Chromium without a screen, and without any network but this computer."""
    need("chromium", "chromedriver")
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in (
        "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1280,800",
        f"--user-data-dir={profile}", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
        "--disable-background-networking", "--disable-component-update", "--disable-sync",
        "--no-first-run", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
    ):  # fmt: skip
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"performance": "ALL"})
    browser = webdriver.Chrome(options, webdriver.ChromeService(driver))
    try:
        yield browser
    finally:
        browser.quit()


TEXT = "return (document.getElementById(arguments[0])?.innerText ?? '').trim();"
"""What an element shows: found and read at once, as the page may replace it in between."""


def text(browser: webdriver.Chrome, ident: str) -> str:
    """Return what an element shows; empty while the page has none such."""
    return str(browser.execute_script(TEXT, ident))


STILL = """
const [element, done] = arguments, before = element.getBoundingClientRect();
requestAnimationFrame(() => requestAnimationFrame(() => {
    const now = element.getBoundingClientRect();
    done(['x', 'y', 'width', 'height'].every(of => before[of] === now[of]));
}));
"""
"""Whether an element stays where it is: a click on one that still moves can miss it."""


def press(browser: webdriver.Chrome, ident: str) -> None:
    wait_for(lambda: any(e.is_displayed() for e in browser.find_elements(By.ID, ident)))
    element = browser.find_element(By.ID, ident)
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", element)
    wait_for(lambda: browser.execute_async_script(STILL, element))
    element.click()


def write(browser: webdriver.Chrome, ident: str, words: str) -> None:
    wait_for(lambda: browser.find_elements(By.ID, ident))
    field = browser.find_element(By.ID, ident)
    field.send_keys(Keys.CONTROL, "a")
    field.send_keys(Keys.NULL, words, Keys.ENTER)


def shown(browser: webdriver.Chrome, ident: str, words: str) -> None:
    wait_for(lambda: words in text(browser, ident))


SCREENS = os.environ.get("LABCRANE_SCREENS")
"""Folder for pictures of the pages, for people to look at."""


def photograph(browser: webdriver.Chrome, name: str) -> None:
    """Take pictures as a wide screen and a tablet show the page."""
    if not SCREENS:
        return
    for width, height in ((1280, 800), (768, 1024)):
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        time.sleep(0.5)  # for the page to settle; only when pictures are wanted
        browser.save_screenshot(f"{SCREENS}/{name}-{width}.png")
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
