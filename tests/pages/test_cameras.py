"""The supervisor sees what the cameras show and how hard the joints work, or that nobody knows."""

import json
import math
import re
import signal
from contextlib import closing
from pathlib import Path

import numpy as np
import psutil
import pytest
from cranes import needs_bullet
from faults.sessions import unique, wait_for
from pages.looks import complaints
from pages.room import STUDY, Room, a_room, photograph, press, shown, text
from rehearsal import loaded
from selenium import webdriver

from labcrane import Frame, Tick, open_recording
from labcrane.protocol.rig import Rig
from labcrane.recording import SessionRecord
from labcrane.testing import ch8
from labcrane_view.settings import ViewSettings
from labcrane_view.view import View

pytestmark = needs_bullet

DEPTH = {
    "name": "depth",
    "eye": [3.5, 4.0, 6.0],
    "look": [3.5, 8.0, 0.0],
    "shows": "depth",
    "depth_m": [2.0, 14.0],
}
VIEW = {
    "display": "hidden",
    "size": [320, 120],
    "camera": DEPTH,
    "beside": ["free"],
    "targets": False,
    "hud": [],
    "notices": False,
    "shadow": 0,
    "rate_hz": 4,
    "supervisor": {"rate_hz": 2},
}
LOADED = STUDY.replace("{{use: kinematic_crane}}", "{{use: bullet_crane, payload_kg: 150}}")
STEPS = "      - instructions: wait.txt\n      - block: {task: aiming, pairs: 1}\n"
PATIENCE_S = 120.0
THEME = "return document.documentElement.dataset.theme"
AGE = r"\d+\.\d s old · white 2 m, black 14 m"
SEEN = """
const image = document.getElementById(arguments[0]);
if (!image || !image.offsetParent || !image.naturalWidth) return null;
const canvas = document.createElement('canvas');
[canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
const context = canvas.getContext('2d');
context.drawImage(image, 0, 0);
const {width, height, data} = context.getImageData(0, 0, canvas.width, canvas.height);
return [width, height, Array.from(data)];
"""
"""What the browser itself makes of an image that can be seen."""


def seen(browser: webdriver.Chrome, ident: str) -> np.ndarray:
    """Return the pixels of an image, shape ``(height, width, 3)``."""
    found: list[tuple[int, int, list[int]]] = []

    def there() -> bool:
        found.extend(filter(None, [browser.execute_script(SEEN, ident)]))
        return bool(found)

    wait_for(there, PATIENCE_S)
    ((width, height, data),) = found
    return np.array(data).reshape(height, width, 4)[..., :3]


def view_process(room: Room) -> psutil.Process:
    children = psutil.Process(room.launcher.pid).children()
    (host,) = (each for each in children if "labcrane.feedback.process" in each.cmdline())
    return host


def ground(column: int, row: int, width: int, height: int) -> float:
    """Return how far along the depth camera's axis the level ground is, from angles alone."""
    (_, y, z), (_, look_y, look_z) = DEPTH["eye"], DEPTH["look"]
    down = math.atan2(z - look_z, look_y - y)
    focal = width / 2 / math.tan(math.radians(70.0) / 2)
    steeper = math.atan2(row + 0.5 - height / 2, focal)
    # The column does not matter: the camera's horizontal is the ground's.
    return z / math.sin(down + steeper) * math.cos(steeper)


@pytest.mark.long
def test_the_supervisor_sees_cameras_and_torques(tmp_path: Path, browser: webdriver.Chrome) -> None:
    protocol = tmp_path / "study.yaml"
    (tmp_path / "wait.txt").write_text("Please wait.\n")
    views = f"views: {{watch: {json.dumps({'use': 'view', **VIEW})}}}\n"
    protocol.write_text(LOADED.format(study=unique("cameras"), steps=STEPS) + views)

    def said() -> str:
        return text(browser, "camera-watch-depth-age")

    with a_room(protocol, tmp_path / "data") as room:
        wait_for(lambda: room.process("pages"))
        browser.get(room.links()["supervisor"])
        shown(browser, "instructions", "Please wait.")
        depth, colour = (seen(browser, f"camera-watch-{name}") for name in ("depth", "free"))
        wait_for(lambda: "N m" in text(browser, "load-shoulder"), PATIENCE_S)
        torques = {name: text(browser, f"load-{name}") for name in ch8().names}
        wait_for(lambda: re.fullmatch(AGE, said()), PATIENCE_S)
        photograph(browser, "cameras")
        for theme in ("dark", "light"):
            webdriver.ActionChains(browser).send_keys("d").perform()
            wait_for(lambda name=theme: browser.execute_script(THEME) == name)
            assert complaints(browser) == [], theme

        # A view that hangs: its last picture is not taken for what is now.
        view_process(room).send_signal(signal.SIGSTOP)
        wait_for(lambda: said().startswith("no picture for"), PATIENCE_S)
        assert browser.execute_script(SEEN, "camera-watch-depth") is None
        photograph(browser, "no-cameras")
        again = seen(browser, "camera-watch-depth")  # it has been started again
        np.testing.assert_array_equal(again, depth)
        press(browser, "order-end")
        press(browser, "order-end-sure")
        press(browser, "close-page")
        assert room.launcher.wait(240) == 0, "".join(room.said)

    height, width, _ = depth.shape
    assert (width, height) == (160, 120)
    for column, row in ((80, 60), (10, 30), (150, 100), (80, 117)):
        away = ground(column, row, width, height)
        assert depth[row, column].tolist() == pytest.approx([255 * (14 - away) / 12] * 3, abs=1.5)

    session = open_recording(room.folder / "P001-PILOT.h5").session(1)
    state = session.streams["state"].data
    standing = len(state) // 2
    for joint in ch8().joints:
        torque = state[f"joint.load.{joint.name}"].iloc[standing] * joint.effort
        newton_metres, percent = re.findall(r"(-?[\d.]+) (?:N m,|%)", torques[joint.name])
        assert float(newton_metres) == pytest.approx(torque, abs=0.06)
        assert float(percent) == pytest.approx(100 * torque / joint.effort, abs=0.06)
    assert "pictures" not in " ".join(session.streams), "nobody asked for pictures in the record"
    assert np.abs(colour - drawn_from(session, protocol, standing)).mean() < 0.5


def drawn_from(session: SessionRecord, protocol: Path, row: int) -> np.ndarray:
    """Return the second camera's picture of a recorded frame."""
    study = loaded(protocol)
    run = Rig.build(study, simulated=True).describe(study, participant_seed=0)
    state = session.streams["state"].data.to_numpy()[row]
    nothing = np.zeros(0)
    frame = Frame(Tick(0, 0.0, 0.0), 0.0, nothing, nothing, state, np.full(run.task.size, math.nan))
    with closing(View(ViewSettings(**{**VIEW, "rate_hz": None}), study.machine)) as view:
        view.open(run)
        view.present(frame)
        view.present(frame)
        return view.picture()[:, VIEW["size"][0] // 2 :].astype(int)
