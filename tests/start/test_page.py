"""The start page in a browser: what is clicked and typed comes to the file, and nothing is lost."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from faults.sessions import wait_for
from pages.looks import complaints
from pages.room import a_browser, text
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select
from start.test_workspace import served

pytestmark = [pytest.mark.slow]

WINDOW = {"width": 1280, "height": 720, "deviceScaleFactor": 1, "mobile": False}
WORDS = json.loads(
    (Path(__file__).parents[2] / "labcrane" / "start" / "words.json").read_text(encoding="utf-8")
)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    with a_browser(tmp_path_factory.mktemp("profile")) as browser:
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", WINDOW)
        yield browser


PRESS = """
const found = document.querySelector(arguments[0]);
found?.focus();
found?.click();
return Boolean(found);
"""
AT = """
const places = [...document.querySelectorAll('[data-place]')];
return places.find(e => e.dataset.place === arguments[0]);
"""

PICK_AT = """
const places = [...document.querySelectorAll('[data-place]')];
const found = places.find(e => e.dataset.place === arguments[0]);
found?.click();
return Boolean(found);
"""
FIELD_AT = """
const places = [...document.querySelectorAll('[data-place]')];
const found = places.find(e => e.dataset.place === arguments[0]);
return found && `${found.disabled ? 'disabled' : 'enabled'}: ${found.closest('.field').innerText}`;
"""
NAME = """
const field = document.getElementById('file-name');
if (!field) return false;
field.value = arguments[0];
field.dispatchEvent(new Event('input'));
return true;
"""
CHOOSE = """
const list = document.getElementById(arguments[0]);
const found = [...(list?.options ?? [])].find(e => e.text === arguments[1]);
if (!found) return false;
list.value = found.value;
list.dispatchEvent(new Event('change'));
return true;
"""
BUTTON = """
const found = [...document.querySelectorAll('button')].find(e => e.textContent === arguments[0]);
found?.click();
return Boolean(found);
"""
TEXT_AT = AT.replace(";\n", "?.innerText;\n").replace("]?.innerText;", "];")


class Page:
    """The page as it is used: by its words and fields, not by what is behind them."""

    def __init__(self, browser: webdriver.Chrome, link: str) -> None:
        self.browser = browser
        browser.get(link)
        wait_for(lambda: browser.find_elements(By.ID, "copy"))

    def press(self, ident: str) -> None:
        """Press a button once it can be; the page may replace it meanwhile."""
        wait_for(lambda: self.browser.execute_script(PRESS, f"#{ident}:not(:disabled)"))

    def at(self, *place: object) -> object:
        wanted = json.dumps(list(place), separators=(",", ":"))
        wait_for(lambda: self.browser.execute_script(AT, wanted))
        return self.browser.execute_script(AT, wanted)

    def choose(self, ident: str, wanted: str) -> None:
        """Choose by its text in a list, in one go."""
        wait_for(lambda: self.browser.execute_script(CHOOSE, ident, wanted))

    def pick(self, *place: object) -> None:
        """Click at a place in one go; the page may draw it anew at any time."""
        wanted = json.dumps(list(place), separators=(",", ":"))
        wait_for(lambda: self.browser.execute_script(PICK_AT, wanted))

    def field_at(self, *place: object) -> str:
        """Return the text of the field around a place as it is now, and whether it is disabled."""
        wanted = json.dumps(list(place), separators=(",", ":"))
        return str(self.browser.execute_script(FIELD_AT, wanted))

    def text_at(self, *place: object) -> str:
        """Return the text of a place as it is now; the page may draw it anew at any time."""
        wanted = json.dumps(list(place), separators=(",", ":"))
        return str(self.browser.execute_script(TEXT_AT, wanted))

    def write(self, value: str, *place: object) -> None:
        self.at(*place).send_keys(Keys.CONTROL, "a")
        self.at(*place).send_keys(value, Keys.TAB)

    def yaml(self) -> str:
        return str(self.browser.execute_script("return document.getElementById('yaml').value"))

    def copied(self, name: str = "mine") -> None:
        self.choose("shipped", "aiming")
        field = self.browser.find_element(By.ID, "name")
        field.clear()
        field.send_keys(name)
        self.press("copy")
        self.at("title")
        self.is_fine()

    def is_fine(self) -> None:
        wait_for(lambda: text(self.browser, "checked") == "labcrane check finds nothing")


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    (tmp_path / "lab").mkdir()
    return tmp_path / "lab"


@pytest.fixture
def page(lab: Path, browser: webdriver.Chrome) -> Iterator[Page]:
    with served(lab) as (_, link):
        yield Page(browser, link)


def test_a_field_and_the_text_follow_each_other_and_undo_takes_both_back(
    page: Page, lab: Path
) -> None:
    page.copied()
    before = page.yaml()
    page.write("Mine: ours", "title")
    wait_for(lambda: 'title: "Mine: ours"' in page.yaml())
    assert page.yaml() == before.replace(
        "title: Aiming movements with a robotic crane", 'title: "Mine: ours"'
    )
    box = page.browser.find_element(By.ID, "yaml")
    box.send_keys(Keys.CONTROL, Keys.HOME)
    box.send_keys("# 🏗 typed\n")
    file = lab / "mine" / "protocol.yaml"
    assert file.read_text(encoding="utf-8") == before
    page.press("save")
    wait_for(lambda: file.read_text(encoding="utf-8").startswith("# 🏗 typed\n# The"))
    while (now := page.yaml()) != before:  # typing may have come in several parts
        page.press("undo")
        wait_for(lambda now=now: page.yaml() != now)
    assert page.at("title").get_attribute("value") == "Aiming movements with a robotic crane"
    page.press("redo")
    wait_for(lambda: 'title: "Mine: ours"' in page.yaml())
    page.press("save")
    wait_for(lambda: 'title: "Mine: ours"' in file.read_text(encoding="utf-8"))


def test_a_finding_is_at_its_field_and_its_button_mends_it(page: Page) -> None:
    page.copied()
    before = page.yaml()
    page.browser.execute_script(
        "const box = document.getElementById('yaml');"
        "box.value = box.value.replace('use: sphere', 'use: spere');"
        "box.dispatchEvent(new Event('input'))"
    )
    wait_for(lambda: "did you mean 'sphere'" in text(page.browser, "findings"))
    page.at("feedback").click()
    field = page.at("feedback", "ball", "use")
    assert field.get_attribute("aria-invalid") == "true"
    [button] = page.browser.find_elements(
        By.XPATH, "//*[@id='findings']//button[text()='Use sphere']"
    )
    button.click()
    wait_for(lambda: page.yaml() == before)
    page.is_fine()


def test_steps_are_added_moved_and_removed_by_keyboard(page: Page) -> None:
    page.copied()
    before = page.yaml()
    steps = ("sessions", 0, "steps")
    kind = page.browser.find_element(By.CSS_SELECTOR, "#form select[aria-label='Kind of step']")
    Select(kind).select_by_visible_text("break")
    page.at(*steps, "add").send_keys(Keys.ENTER)
    wait_for(lambda: "- break: {seconds: " in page.yaml())
    lines = page.yaml().splitlines()
    [at] = [n for n, line in enumerate(lines) if "- break:" in line]
    assert [*lines[:at], *lines[at + 1 :]] == before.splitlines()
    page.is_fine()
    page.at(*steps, 1, "later").send_keys(Keys.ENTER)
    wait_for(lambda: "break" in page.text_at(*steps, 2))
    page.at(*steps, 2, "remove").send_keys(Keys.ENTER)
    wait_for(lambda: page.yaml() == before)


def test_a_newer_file_is_asked_about_and_no_answer_keeps_both(page: Page, lab: Path) -> None:
    page.copied()
    file = lab / "mine" / "protocol.yaml"
    other = file.read_text(encoding="utf-8") + "# by another program\n"
    page.at("participants").click()
    page.write("48", "participants", "planned")
    wait_for(lambda: "planned: 48" in page.yaml())
    file.write_text(other, encoding="utf-8")
    wait_for(lambda: "changed by another program" in text(page.browser, "state"))
    page.press("save")
    page.press("question[open] #keep")
    assert file.read_text(encoding="utf-8") == other
    assert "planned: 48" in page.yaml()
    page.press("save")
    page.press("question[open] #reload")
    wait_for(lambda: page.yaml() == other)
    page.press("undo")
    wait_for(lambda: "planned: 48" in page.yaml())
    file.with_name("protocol.lock.json").write_text("{}", encoding="utf-8")
    page.press("save")
    wait_for(lambda: "labcrane amend" in text(page.browser, "question"))
    page.press("question[open] #over")
    wait_for(lambda: "planned: 48" in file.read_text(encoding="utf-8"))


def test_a_server_that_is_killed_is_reported_and_the_next_one_has_the_text(
    lab: Path, browser: webdriver.Chrome
) -> None:
    with served(lab) as (server, link):
        page = Page(browser, link)
        page.copied()
        page.write("Kept", "title")
        wait_for(lambda: "title: Kept" in page.yaml())
        server.kill()
        wait_for(lambda: "does not answer" in text(browser, "alert"))
        assert "title: Kept" in page.yaml()
    with served(lab) as (_, link):
        page = Page(browser, link)
        browser.find_element(By.XPATH, "//button[text()='mine/protocol.yaml']").click()
        assert page.at("title").get_attribute("value") == "Kept"
        assert "your unsaved text is back" in text(browser, "state")


def test_a_command_runs_with_its_line_its_output_and_a_stop(page: Page) -> None:
    page.copied()
    page.press("tab-do")
    wait_for(lambda: page.browser.find_elements(By.CSS_SELECTOR, "[data-place=plan]"))
    page.press("all > summary")
    page.press("all [data-place=plan]")
    wait_for(lambda: "labcrane plan" in page.browser.find_element(By.ID, "main").text)
    page.press("start")
    wait_for(lambda: "balanced" in text(page.browser, "log"))
    assert text(page.browser, "command") == "labcrane plan protocol.yaml"
    assert not complaints(page.browser)
    page.press("all [data-place=study]")
    wait_for(lambda: "labcrane study" in page.browser.find_element(By.ID, "main").text)
    page.press("start")
    wait_for(lambda: page.browser.find_elements(By.CSS_SELECTOR, "#links a"))
    page.press("stop")
    wait_for(lambda: text(page.browser, "status") not in {"Running", ""})


def test_a_command_sees_every_file_as_it_was_typed(page: Page, lab: Path) -> None:
    """It ran with the protocol as it was on the disk, while the plan showed what was typed."""
    page.copied()
    page.at("participants").click()
    page.write("8", "participants", "planned")
    wait_for(lambda: "planned: 8" in page.yaml())
    page.choose("file", "instructions.md")
    wait_for(lambda: "other files not saved: 1 (protocol.yaml)" in text(page.browser, "state"))
    page.press("tab-do")
    wait_for(lambda: page.browser.find_elements(By.ID, "all"))
    page.press("all > summary")
    page.press("all [data-place=plan]")
    wait_for(lambda: "labcrane plan" in page.browser.find_element(By.ID, "main").text)
    page.press("start")
    wait_for(lambda: "balanced" in text(page.browser, "log"))
    assert "P008" in text(page.browser, "log")
    assert "P009" not in text(page.browser, "log")
    assert "other files" not in text(page.browser, "state")


def test_each_simulation_has_a_new_folder_and_the_report_is_of_the_newest(
    page: Page, lab: Path
) -> None:
    page.copied()
    (lab / "mine" / "simulated").mkdir()
    (lab / "mine" / "tables").mkdir()
    page.press("tab-do")

    def preset(task: str) -> list[str]:
        page.press(f"main [data-place={task}]")
        wait_for(
            lambda: page.browser.find_elements(
                By.CSS_SELECTOR, f"[data-place={task}][aria-pressed=true]"
            )
        )
        fields = page.browser.find_elements(By.CSS_SELECTOR, "input[id^=option-]")
        return [each.get_attribute("value") for each in fields]

    assert "simulated-2" in preset("people")
    assert {"simulated", "simulated-report"} <= {*preset("their_report")}
    assert "tables-2" in preset("tables")
    (lab / "mine" / "simulated-2").mkdir()
    assert "simulated-3" in preset("people")
    assert {"simulated-2", "simulated-2-report"} <= {*preset("their_report")}


REPLACE = """
const box = document.getElementById('yaml');
box.value = arguments[0];
box.dispatchEvent(new Event('input'));
"""


def test_a_remedy_counts_signs_beyond_the_first_plane_as_one(page: Page) -> None:
    """It replaced other letters: JavaScript counts 🏗 as two."""
    page.copied()
    data = page.browser.execute_async_script(
        "const done = arguments[0];"
        "fetch('/ask/show', {method: 'POST', body: '{}'}).then(a => a.json()).then(done)"
    )["data"]
    data = {"title": "🏗🏗 both 🏗", **{key: data[key] for key in data if key != "title"}}
    right = json.dumps(data, ensure_ascii=False)
    page.browser.execute_script(REPLACE, right.replace('"sphere"', '"spere"', 1))
    wait_for(lambda: "did you mean 'sphere'" in text(page.browser, "findings"))
    found = "//*[@id='findings']//button[text()='Use sphere']"
    page.browser.find_element(By.XPATH, found).click()
    wait_for(lambda: page.yaml() == right)


def test_a_value_that_an_anchor_ties_says_that_it_is_changed_in_the_yaml(page: Page) -> None:
    page.copied()
    tied = page.yaml().replace("far: 4.0", "far: &far 4.0", 1).replace("far: 4.0", "far: *far", 1)
    page.browser.execute_script(REPLACE, tied)
    wait_for(lambda: "*far" in page.yaml())
    page.pick("feedback")
    for name in ("ball", "tone"):
        wait_for(lambda name=name: "disabled: " in page.field_at("feedback", name, "far"))
        field = page.field_at("feedback", name, "far")
        assert "An anchor ties this to another value; change it in the YAML." in field
    assert "enabled: " in page.field_at("feedback", "ball", "at")


def test_a_paste_that_is_too_long_is_refused_with_the_limit(page: Page) -> None:
    page.copied()
    before = page.yaml()
    page.browser.execute_script(REPLACE, "# " + "x" * 40_000 + "\n" + before)
    page.press("save")
    wait_for(lambda: "40" and text(page.browser, "state").endswith("saved"))
    page.browser.execute_script(REPLACE, "# " + "x" * 300_000 + "\n" + before)
    wait_for(lambda: "longer than the 256000 bytes" in text(page.browser, "alert"))


def test_instructions_are_opened_at_their_step_edited_and_saved(page: Page, lab: Path) -> None:
    page.copied()
    page.write("Mine", "title")
    wait_for(lambda: "title: Mine" in page.yaml())
    wait_for(lambda: page.browser.execute_script(BUTTON, "Open instructions.md"))
    wait_for(lambda: text(page.browser, "title") == "instructions.md")
    page.browser.execute_script(REPLACE, "Move the crane 🏗.\n")
    wait_for(lambda: "Move the crane 🏗." in text(page.browser, "form"))
    page.press("save")
    file = lab / "mine" / "instructions.md"
    wait_for(lambda: file.read_text(encoding="utf-8") == "Move the crane 🏗.\n")
    page.choose("file", "New file")
    wait_for(lambda: page.browser.execute_script(NAME, "tlx.yaml"))
    page.press("make")
    wait_for(lambda: text(page.browser, "title") == "tlx.yaml")
    page.choose("file", "protocol.yaml")
    wait_for(lambda: text(page.browser, "title") == "protocol.yaml")
    assert page.at("title").get_attribute("value") == "Mine", "unsaved, and kept"
    assert complaints(page.browser) == []


def test_the_plan_of_each_participant_is_a_table(page: Page) -> None:
    page.copied()
    page.at("participants").click()
    page.write("8", "participants", "planned")
    wait_for(lambda: "planned: 8" in page.yaml())
    page.press("tab-plan")
    wait_for(lambda: len(page.browser.find_elements(By.CSS_SELECTOR, "#plan tbody tr")) == 8)
    assert text(page.browser, "balance").startswith("balanced: groups of equal size")
    first = page.browser.find_element(By.CSS_SELECTOR, "#plan tbody tr").text
    assert first.startswith("P001 1 acquisition")
    assert "32" in first
    assert "min" in first
    assert complaints(page.browser) == []


def test_the_pages_of_the_participant_are_opened_from_the_strip(page: Page) -> None:
    page.choose("shipped", "whole")
    page.press("copy")
    page.is_fine()
    page.at("sessions", 0, "steps", 0, "pages").send_keys(Keys.ENTER)
    wait_for(lambda: page.browser.find_elements(By.CSS_SELECTOR, "#links a"))
    link = page.browser.find_element(By.CSS_SELECTOR, "#links a").get_attribute("href")
    assert text(page.browser, "command") == "labcrane pages protocol.yaml"
    here = page.browser.current_window_handle
    page.browser.switch_to.new_window("tab")
    page.browser.get(link)
    wait_for(lambda: text(page.browser, "text").startswith("Move the tip of the crane"))
    page.browser.find_element(By.LINK_TEXT, "8 accuracy").click()
    wait_for(lambda: page.browser.find_elements(By.ID, "submit"))
    page.press("submit")
    wait_for(lambda: "missing" in text(page.browser, "refusal"))
    wait_for(lambda: page.browser.execute_script(PRESS, ".form-scale button"))
    given = ".form-scale button:first-child[aria-pressed=true]"
    wait_for(lambda: page.browser.find_elements(By.CSS_SELECTOR, given))
    page.browser.close()
    page.browser.switch_to.window(here)
    page.press("stop")


@pytest.mark.parametrize("language", ["en", "de", "pl", "fr", "es"])
def test_the_page_can_be_used_by_everybody_in_each_language(page: Page, language: str) -> None:
    Select(page.browser.find_element(By.ID, "language")).select_by_visible_text(
        WORDS[language]["own"]
    )
    wait_for(lambda: text(page.browser, "copy") == WORDS[language]["copy"])
    assert complaints(page.browser) == []
    page.press("copy")
    page.at("title")
    for section in page.browser.find_elements(By.CSS_SELECTOR, "details:not([open]) > summary"):
        section.click()
    assert complaints(page.browser) == []
    shown = page.browser.find_element(By.TAG_NAME, "body").text
    assert "undefined" not in shown
    assert page.browser.execute_script("return document.documentElement.lang") == language
    wide = "return document.documentElement.scrollWidth <= innerWidth"
    assert page.browser.execute_script(wide), "nothing is beyond the window"
    page.press("tab-do")
    wait_for(lambda: page.browser.find_elements(By.ID, "start"))
    assert complaints(page.browser) == []


def test_every_language_has_all_words() -> None:
    assert {tuple(words) for words in WORDS.values()} == {tuple(WORDS["en"])}
    for words in WORDS.values():
        for name, word in words.items():
            assert word.count("{") == WORDS["en"][name].count("{"), (name, word)
