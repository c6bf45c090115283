"""Films in the viewer: the picture shown is the frame that stands at the time shown."""

import random
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import av
import h5py
import numpy as np
import pytest
from faults.sessions import finished, labcrane, wait_for
from faults.test_filmed_session import STUDY, WHO, filming, size
from pages.looks import check
from pages.room import shown, text
from pages.test_viewer import GO, reached
from selenium import webdriver
from selenium.webdriver.common.by import By

from labcrane import ProtocolError, open_recording
from labcrane.web.viewer.codes import read_codes

BLOCK, BITS = 16, 12
TESTED = "testsrc2=size=160x120:rate=30"
BARS = (
    f"color=size={BLOCK * BITS}x32:rate=30,"
    f"geq=lum='if(bitand(N,pow(2,floor(X/{BLOCK}))),255,0)':cb=128:cr=128"
)
"""The number of each frame, as black and white blocks."""

NUMBER = f"""
const [at, name] = arguments, image = document.getElementById('film-' + name);
if (!image || Number(image.dataset.at) !== at || !image.complete) return null;
const canvas = document.createElement('canvas');
canvas.width = image.naturalWidth; canvas.height = image.naturalHeight;
const paint = canvas.getContext('2d');
paint.drawImage(image, 0, 0);
let number = 0;
for (let bit = 0; bit < {BITS}; bit++)
    if (paint.getImageData(bit * {BLOCK} + 8, 16, 1, 1).data[0] > 128) number += 2 ** bit;
return number;
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session whose camera sends numbered pictures and is killed once."""
    folder = tmp_path_factory.mktemp("filmed")
    protocol, data = folder / "study.yaml", folder / "data"
    assert TESTED in STUDY
    protocol.write_text(STUDY.replace(TESTED, BARS))
    launcher = labcrane("run", protocol, *WHO, data)
    there = data / "P001-SIMULATED"
    wait_for(lambda: size(there / "ses-01_run.xdf") > 300_000)
    wait_for(lambda: size(there / "ses-01_face.mkv") > 0)
    filming(launcher, "face").kill()
    finished(launcher)
    return there / f"{there.name}.h5"


CODED = """
const shown = document.getElementById('film-face')?.dataset.at;
if (!(shown > 0.7)) return null; // not yet, or in the gap of the camera that was killed
document.body.dispatchEvent(new KeyboardEvent('keydown', {key: arguments[0], bubbles: true}));
return shown;
"""


@contextmanager
def viewing(file: Path, browser: webdriver.Chrome, *words: str) -> Iterator[None]:
    command = [sys.executable, "-m", "labcrane", "view", str(file), *words]
    viewer = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        link = next(line for line in viewer.stdout if line.startswith("viewer: ")).split()[1]
        wait_for(lambda: reached(browser, link))
        shown(browser, "clock", "of 0:00:")
        yield
    finally:
        viewer.terminate()
        viewer.wait(240)
        viewer.stdout.close()


def numbers(path: Path) -> dict[int, int]:
    """Return the number that each frame of a film shows, by its place in milliseconds."""
    with av.open(str(path)) as film:
        found = {}
        for frame in film.decode(0):
            grey = frame.to_ndarray(format="gray")[16, BLOCK // 2 :: BLOCK]
            number = sum(1 << bit for bit, level in enumerate(grey) if level > 128)
            found[round(1000 * frame.time)] = number
    return found


@pytest.mark.slow
def test_the_picture_shown_is_the_frame_at_the_time_shown(
    file: Path, browser: webdriver.Chrome
) -> None:
    with h5py.File(file) as opened:
        session = opened["ses-01"]
        loop, stream = session["time"][:], session["streams/labcrane.capture.face"]
        time_s, columns = stream["time"][:], stream["data"]
        kept = {each: columns[each][:] for each in ("file", "pts", "frame.number")}
    films = {n: numbers(file.parent / f"ses-01_face{('', '.2')[n - 1]}.mkv") for n in (1, 2)}
    dice, pictures, gaps = random.Random(76), 0, 0
    with viewing(file, browser):
        (at,) = np.flatnonzero(np.diff(kept["file"]))
        within = 0.5 * (time_s[at] + time_s[at + 1]) - loop[0]
        while pictures < 50:
            second = dice.uniform(0.0, loop[-1] - loop[0]) if gaps else within
            browser.execute_script(GO, second)
            row = int(np.flatnonzero(time_s <= loop[0] + second)[-1])
            follows = row + 1 < len(time_s) and kept["file"][row + 1] == kept["file"][row]
            follows &= kept["frame.number"][row + 1 : row + 2] == kept["frame.number"][row] + 1
            if not follows and loop[0] + second - time_s[row] > 0.05:
                gaps += 1
                wait_for(lambda: text(browser, "film-said-face").startswith("no frame"))
                assert not browser.execute_script("return document.getElementById('film-face')")
                continue
            wanted = films[int(kept["file"][row])][round(1000 * kept["pts"][row])]
            wait_for(lambda s=second, n=wanted: browser.execute_script(NUMBER, s, "face") == n)
            pictures += 1
        check(browser, "viewer with films")


@pytest.mark.slow
def test_sound_is_played_with_the_time_that_is_shown(file: Path, browser: webdriver.Chrome) -> None:
    apart = """
    const player = document.getElementById('sound-room');
    const t = Number(document.getElementById('scrub').value);
    return player.duration && !player.paused ? [player.currentTime, t] : null;
    """
    with viewing(file, browser, "--at", "1"):
        wait_for(lambda: browser.execute_script("return document.getElementById('hear-room')"))
        for ident in ("hear-room", "play"):  # by hand: else a browser plays nothing
            browser.find_element(By.ID, ident).click()
        found: list[list[float]] = []

        def heard() -> bool:
            found.extend([both] if (both := browser.execute_script(apart)) else [])
            return len(found) > 30

        wait_for(heard, 60.0)
        offset = np.subtract(*np.array(found[5:]).T)  # once it has begun
        assert np.ptp(offset) < 0.2


@pytest.mark.slow
def test_without_the_file_the_viewer_says_why_there_is_no_picture(
    file: Path, browser: webdriver.Chrome
) -> None:
    gone = file.with_name("ses-01_face.mkv")
    gone.rename(file.with_name("elsewhere"))
    try:
        with viewing(file, browser, "--at", "0.5"):
            wait_for(lambda: "face: file 1 is missing" in text(browser, "film-said-face"))
    finally:
        file.with_name("elsewhere").rename(gone)


CODES = """\
g: {name: looks away, lasts: true}
s: {name: slip}
"""


@pytest.mark.slow
def test_behaviour_is_coded_by_keys_and_saved_at_once(
    file: Path, browser: webdriver.Chrome, tmp_path: Path
) -> None:
    codes = tmp_path / "codes.yaml"
    codes.write_text(CODES)
    record = open_recording(file).session(1)
    begun = record.events.set_index("name")["time"]["trial.start"].iloc[0]
    zero = record.streams["loop"].time[0]

    def coded() -> list[tuple[object, ...]]:
        kept = record.annotations
        return [
            (round(time - zero, 3), round(until - zero, 3), text, coder)
            for time, until, text, _, coder in kept.itertuples(index=False, name=None)
        ]

    words = ("--at", "trial.start", "--codes", str(codes), "--coder", "AB")
    with viewing(file, browser, *words):
        at = "return Number(document.getElementById('second').value)"
        wait_for(lambda: abs(browser.execute_script(at) - (begun - zero)) < 0.006)
        page = browser.find_element(By.TAG_NAME, "body")
        browser.execute_script(GO, 2.0)
        page.send_keys("g")
        wait_for(lambda: coded() == [(2.0, 2.0, "looks away", "AB")])
        wait_for(lambda: "since 0:00:02" in text(browser, "code-g"))
        browser.execute_script(GO, 3.0)
        page.send_keys("s")
        browser.execute_script(GO, 3.5)
        page.send_keys("g")
        whole = [(2.0, 3.5, "looks away", "AB"), (3.0, 3.0, "slip", "AB")]
        wait_for(lambda: coded() == whole)
        for ident, word in (("code-key", "x"), ("code-name", "points")):
            browser.find_element(By.ID, ident).send_keys(word)
        browser.find_element(By.ID, "code-add").click()
        browser.execute_script(GO, 4.0)
        page.send_keys("x")
        wait_for(lambda: coded() == [*whole, (4.0, 4.0, "points", "AB")])
        browser.execute_script(GO, 0.5)
        browser.find_element(By.ID, "play").click()
        times: list[str] = []
        wait_for(lambda: times or times.extend(filter(None, [browser.execute_script(CODED, "x")])))
        shown = pytest.approx(float(times[0]), abs=1.5e-3)
        wait_for(lambda: len(coded()) == len(whole) + 2)
        # Of the picture, not of the clock.
        assert [each for each in coded() if each == (shown, shown, "points", "AB")]
        check(browser, "viewer with codes")
    (kept,) = file.parent.glob("*_annotations.jsonl")
    assert stat.S_IMODE(kept.stat().st_mode) == stat.S_IMODE(file.stat().st_mode)


@pytest.mark.parametrize(
    ("text", "why"),
    [("m: {name: x}", "the viewer has keys"), ("gg: {name: x}", "not a scheme"),
     ("g: {name: x, last: 1}", "not a scheme"), ("- g", "not a scheme")],
)  # fmt: skip
def test_a_scheme_that_cannot_be_used_is_refused(text: str, why: str, tmp_path: Path) -> None:
    path = tmp_path / "codes.yaml"
    path.write_text(text)
    with pytest.raises(ProtocolError, match=why):
        read_codes(path)
    path.write_text(CODES)
    assert read_codes(path)[1] == {"key": "s", "name": "slip", "lasts": False}
