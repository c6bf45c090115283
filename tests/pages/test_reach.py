"""Both pages by keyboard alone, readable, and in German."""

from collections.abc import Iterator

import pytest
from faults.sessions import unique, wait_for
from pages.room import STUDY, Room, a_room, photograph, press, shown, text
from selenium import webdriver
from selenium.webdriver.common.keys import Keys

GERMAN = """\
page: {language: de}
questionnaires:
  person: {use: demographics, language: de}
  genau: {use: subjective_accuracy, language: de}
"""
STEPS = """\
      - questionnaire: [person, genau]
      - block: {task: aiming, pairs: 1}
"""

NAME = "const name = e => e.id || e.getAttribute('aria-label') || e.textContent || e.type;"
CONTROLS = f"""{NAME}
const shown = e => e.offsetParent !== null && !e.disabled && e.type !== 'file';
return [...document.querySelectorAll('button, input, a[href]')].filter(shown).map(name);
"""
FOCUSED = f"{NAME} return name(document.activeElement);"

# Relative luminance and contrast as WCAG 2.2 defines them; what is translucent is blended.
FAINT = """
const parse = c => { const n = c.match(/[0-9.]+/g).map(Number);
                     return n.length < 4 ? [...n, 1] : n; };
const over = (a, b) => [0, 1, 2].map(i => a[i] * a[3] + b[i] * (1 - a[3])).concat(1);
const behind = e => {
    if (!e) return [255, 255, 255, 1];
    const own = parse(getComputedStyle(e).backgroundColor);
    return own[3] === 1 ? own : over(own, behind(e.parentElement));
};
const light = c => [0, 1, 2].map(i => c[i] / 255)
    .map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
const ratios = {};
for (const e of document.body.querySelectorAll('*')) {
    const said = [...e.childNodes].filter(n => n.nodeType === 3 && n.textContent.trim());
    if (!said.length || e.offsetParent === null || e.tagName === 'SCRIPT') continue;
    const back = behind(e), front = over(parse(getComputedStyle(e).color), back);
    const [low, high] = [light(back), light(front)].sort((a, b) => a - b);
    ratios[said[0].textContent.trim()] = (high + 0.05) / (low + 0.05);
}
return ratios;
"""


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Room]:
    folder = tmp_path_factory.mktemp("reach")
    protocol = folder / "study.yaml"
    protocol.write_text(STUDY.format(study=unique("reach"), steps=STEPS) + GERMAN)
    with a_room(protocol, folder / "data") as room:
        wait_for(lambda: room.process("pages"))
        yield room


def type_in(browser: webdriver.Chrome, *keys: str) -> None:
    webdriver.ActionChains(browser).send_keys(*keys).perform()


def by_tab(browser: webdriver.Chrome) -> set[str]:
    """Return what the tab key reaches, once round the page."""
    browser.execute_script("document.activeElement.blur()")
    reached: list[str] = []
    while len(reached) < 100:
        type_in(browser, Keys.TAB)
        at = browser.execute_script(FOCUSED)
        if reached and at == reached[0]:
            break
        reached.append(at)
    return set(reached)


def go_to(browser: webdriver.Chrome, ident: str) -> None:
    """Move the focus on by the tab key until it is there."""
    for _ in range(100):
        if browser.execute_script(FOCUSED) == ident:
            return
        type_in(browser, Keys.TAB)
    raise AssertionError(f"the tab key does not reach {ident}")


def check_reach_and_contrast(browser: webdriver.Chrome, at_least: int) -> None:
    controls = browser.execute_script(CONTROLS)
    assert len(controls) >= at_least
    assert set(controls) <= by_tab(browser)
    ratios = browser.execute_script(FAINT)
    assert len(ratios) > at_least
    assert {words: ratio for words, ratio in ratios.items() if ratio < 4.5} == {}


@pytest.mark.slow
def test_the_supervisors_page_is_reached_by_keyboard_and_readable(
    room: Room, browser: webdriver.Chrome
) -> None:
    browser.get(room.links()["supervisor"])
    shown(browser, "stage", "questionnaire: Zu Ihrer Person")
    check_reach_and_contrast(browser, at_least=19)
    go_to(browser, "note-field")
    type_in(browser, "hello", Keys.ENTER)
    shown(browser, "events", "Note: hello")
    wait_for(lambda: not value(browser, "note-field"))  # it is a draft until the page is told


VALUE = "return document.getElementById(arguments[0])?.value ?? ''"
KEPT = "return JSON.stringify(sessionStorage)"
ACKNOWLEDGED = "return window.ackedMessageId >= 0"
AWAY = """
const [away_ms, done] = arguments;
const connection = window.socket.io;
window.stays = true;
connection.reconnectionDelay(away_ms).reconnectionDelayMax(away_ms).randomizationFactor(0);
window.socket.once('disconnect', () =>
    window.socket.once('connect', () => setTimeout(() => done(window.socket.connected), 1000)));
connection.engine.close();
"""
"""Loses the connection as by the network, and waits until it has been taken up again for a second.

``socket.disconnect()`` is somebody's wish: the page then does not say, when it is back, up to where
it has heard, and where it had acknowledged anything before, it is loaded anew.
"""


@pytest.mark.slow
def test_what_is_half_written_outlives_a_connection_that_was_lost(
    room: Room, browser: webdriver.Chrome
) -> None:
    browser.get(room.links()["supervisor"])
    shown(browser, "stage", "questionnaire: Zu Ihrer Person")
    assert value(browser, "note-field") == ""
    go_to(browser, "note-field")
    type_in(browser, "half a ")
    wait_for(lambda: browser.execute_script(ACKNOWLEDGED))  # what it was loaded with is not kept
    browser.set_script_timeout(240)
    assert browser.execute_async_script(AWAY, 5000)
    assert browser.execute_script("return window.stays")
    type_in(browser, "note", Keys.ENTER)
    shown(browser, "events", "Note: half a note")
    wait_for(lambda: not value(browser, "note-field"))


def value(browser: webdriver.Chrome, ident: str) -> str:
    return str(browser.execute_script(VALUE, ident))


@pytest.mark.slow
def test_what_is_half_written_outlives_that_the_page_is_loaded_anew(
    room: Room, browser: webdriver.Chrome
) -> None:
    links = room.links()
    browser.get(links["supervisor"])
    shown(browser, "stage", "questionnaire: Zu Ihrer Person")
    go_to(browser, "note-field")
    type_in(browser, "two ")
    browser.refresh()
    wait_for(lambda: value(browser, "note-field") == "two ")
    go_to(browser, "note-field")
    type_in(browser, Keys.END, "halves", Keys.ENTER)
    shown(browser, "events", "Note: two halves")
    wait_for(lambda: not value(browser, "note-field"))
    browser.refresh()
    shown(browser, "events", "Note: two halves")
    assert value(browser, "note-field") == ""

    # An answer, in a process of the pages that has never heard of it.
    browser.get(links["participant"])
    wait_for(lambda: "Wie alt sind Sie" in text(browser, "item-age"))
    go_to(browser, "age-field")
    type_in(browser, "44")
    pages = room.process("pages")
    pages.kill()
    wait_for(lambda: not pages.is_running())
    wait_for(lambda: room.process("pages"))
    browser.get(links["participant"])
    wait_for(lambda: value(browser, "age-field") == "44")
    assert text(browser, "status-age") == ""
    press(browser, "submit")  # what was put back counts, though nobody has been in the field
    shown(browser, "status-age", "gespeichert")

    # What the record has taken is no draft any more.
    wait_for(lambda: "person age" not in browser.execute_script(KEPT))
    browser.refresh()
    wait_for(lambda: value(browser, "age-field") == "44")


@pytest.mark.slow
def test_a_questionnaire_is_answered_in_german_and_by_keyboard_alone(
    room: Room, browser: webdriver.Chrome
) -> None:
    browser.get(room.links()["participant"])
    wait_for(lambda: "Wie alt sind Sie" in text(browser, "item-age"))
    photograph(browser, "german")
    check_reach_and_contrast(browser, at_least=15)
    go_to(browser, "age-field")
    type_in(browser, "7", Keys.ENTER)
    shown(browser, "status-age", "nicht angenommen: Möglich ist 16 bis 99 in Schritten von 1")
    type_in(browser, Keys.BACKSPACE, "31", Keys.ENTER)
    shown(browser, "status-age", "gespeichert")
    go_to(browser, "sex-female")
    assert text(browser, "sex-female") == "weiblich"
    type_in(browser, Keys.SPACE)
    shown(browser, "status-sex", "gespeichert")
    go_to(browser, "submit")
    type_in(browser, Keys.ENTER)
    shown(browser, "refusal", "Es fehlen noch Antworten")
    for item in ("handedness", "experience", "gaming"):
        press(browser, f"decline-{item}")
        shown(browser, f"status-{item}", "ohne Angabe")
    press(browser, "submit")
    shown(browser, "item-rating", "Vollkommen genau")
    press(browser, "rating-8")
    shown(browser, "status-rating", "gespeichert")
    press(browser, "submit")
    shown(browser, "wait", "Bitte warten")
