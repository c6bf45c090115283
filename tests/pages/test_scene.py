"""The supervisor sees the scene of a running scenario, where the session has it."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from faults.sessions import unique, wait_for
from governed import edit
from pages.room import a_room, photograph, press, shown
from selenium import webdriver

from labcrane import open_recording
from labcrane.machines import PlacedObject, Segment, read_placed, segments, stands
from labcrane.recording.journal_reader import read_journal

ROOT = Path(__file__).parents[2]
SEEN = """
const found = {};
window['scene_' + document.querySelector('.nicegui-scene').id].traverse(o => {
    const body = !o.children.length || o.name.startsWith('body ');
    const {x, y, z} = o.position;
    if (o.name && !body) found[o.name] = [x, y, z, o.children.length];
});
return found;
"""
"""Where three.js has what has a name, and of how many parts it is."""


def around(things: str) -> list[tuple[PlacedObject, Segment]]:
    """Return what an event placed, each with its segments."""
    return [(each, segment) for each in read_placed(things) for segment in segments(each)]


def first_placed(journal: Path) -> list[tuple[PlacedObject, Segment]]:
    """Return what a running session's journal says was placed first; nothing while it is silent."""
    log, _ = read_journal([journal])
    found = [event.data["things"] for event in log.events if event.name == "scene.placed"]
    return around(found[0]) if found else []


def counted(seen: dict[str, list[float]]) -> dict[str, int]:
    """Return of how many parts each is that the page has."""
    return {name: int(parts) for name, (*_, parts) in seen.items()}


@pytest.mark.long
def test_what_stands_around_the_machine_is_drawn_where_the_session_has_it(
    tmp_path: Path, browser: webdriver.Chrome
) -> None:
    folder = tmp_path / "rescue"
    shutil.copytree(
        ROOT / "protocols" / "retrieval", folder, ignore=shutil.ignore_patterns("hydraulic_arm")
    )
    protocol = folder / "protocol.yaml"
    text = protocol.read_text()
    start = text.index("input:")
    text = (
        text[:start]
        + "input: {use: scenario_operator, button: float.base}\n"
        + text[text.index("operator:") :]
    )
    text = re.sub(r"views:\n( .*\n)*", "", text)  # windows need a screen
    protocol.write_text(text.replace("study: retrieval", f"study: {unique('rescue')}"))
    edit(protocol, r"pattern: 'R\d{3}'", r"pattern: 'P\d{3}'")
    with a_room(protocol, tmp_path / "data") as room:
        wait_for(lambda: room.process("pages"))
        browser.get(room.links()["supervisor"])
        for what in ("The operator reads the instructions", "ready to start: retrieval"):
            shown(browser, "stage", what)
            press(browser, "order-start")
        shown(browser, "stage", "trial")
        (journal,) = (tmp_path / "data").rglob("ses-01_run.xdf")
        wait_for(lambda: first_placed(journal))
        parts = {segment.name: len(segment.parts) for _, segment in first_placed(journal)}
        wait_for(
            lambda: counted(browser.execute_script(SEEN)) == parts
        )  # one arrives after another
        press(browser, "raw")
        shown(browser, "facts", "loop at most")
        seen = browser.execute_script(SEEN)
        photograph(browser, "scenario")
        press(browser, "order-end")
        press(browser, "order-end-sure")
        press(browser, "close-page")
        room.ended()
    session = open_recording(room.folder / "P001-PILOT.h5").session(1)
    events = session.events
    drawn = around(events[events["name"] == "scene.placed"]["data"].iloc[0]["things"])
    assert {segment.name: len(segment.parts) for _, segment in drawn} == counted(seen)
    state = session.streams["state"].data
    placed_at = {segment.name: stands(each, segment.parts[0])[0] for each, segment in drawn}
    for name, (*where, _) in seen.items():
        columns = [f"scene.{name}.position.{axis}" for axis in "xyz"]
        moves = columns[0] in state  # what is fixed is where it was placed
        recorded = state[columns].to_numpy() if moves else np.array([placed_at[name]])
        assert np.nanmin(np.linalg.norm(recorded - where, axis=1)) < 0.001
