"""A computer without OpenGL, second monitor or sound: said in words, and then as asked."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from rehearsal import SHORT, a_study
from windows import an_x_server

from labcrane import DeviceError
from labcrane.feedback.processes import FeedbackProcesses
from labcrane.testing import Visit

STUDY = """\
feedback:
  tone: {use: sonification, driver: jack}
views:
  plain: {use: view, size: [160, 90]}
  mirror: {use: view, size: [160, 90], flip: horizontal}
  second: {use: view, screen: 7}
"""

MESSAGES = {
    "mirror": r"the window is flipped, which the software renderer cannot; use OpenGL \(Mesa's",
    "second": r"there is no screen 7; there is 0 \(\S+, 1000x700\)",
    "tone": r"the jack sound system does not take 48000 Hz in .*; start a JACK server first",
}


@pytest.fixture(scope="module", autouse=True)
def bare_computer() -> Iterator[None]:
    """A display that has no OpenGL, and nothing that plays sound."""
    with an_x_server("-extension", "GLX") as display, pytest.MonkeyPatch.context() as patch:
        patch.setenv("DISPLAY", display)
        patch.setenv("JACK_DEFAULT_SERVER", "nobody")
        patch.setenv("JACK_NO_START_SERVER", "1")
        yield


def processes(folder: Path, text: str, policy: str) -> FeedbackProcesses:
    study = a_study(folder, SHORT + text + f"on_fault: {{feedback_lost: {policy}}}\n")
    return FeedbackProcesses(Visit(study, "P001", 1, folder, simulated=True))


@pytest.mark.slow
def test_a_session_goes_on_without_what_is_missing_where_the_protocol_says_so(
    tmp_path: Path,
) -> None:
    made = processes(tmp_path, STUDY, "continue")
    said: list[str] = []
    try:
        assert made.wait(said.append, lambda: False)
        (ready,) = (handle for handle in made.handles if not handle.given_up)
    finally:
        made.stop()
    assert ready.name == "plain"
    told = "\n".join(said)
    for name, message in MESSAGES.items():
        assert re.search(rf"^feedback {name} failed: {message}.*; it is left out$", told, re.M), (
            told
        )
    # Without OpenGL the picture is drawn in software, and that is said.
    assert ready.facts.startswith("renderer p3tinydisplay (software: no graphics card")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "policy"),
    [("mirror", "restart"), ("second", "pause"), ("tone", "pause")],
)
def test_a_session_is_refused_where_it_does_not(name: str, policy: str, tmp_path: Path) -> None:
    lines = [line for line in STUDY.splitlines() if f"  {name}:" in line]
    group = "feedback" if name == "tone" else "views"
    made = processes(tmp_path, f"{group}:\n{lines[0]}\n", policy)
    try:
        said = rf"^feedback '{name}' cannot be started: {MESSAGES[name]}"
        with pytest.raises(DeviceError, match=said):
            made.wait(lambda said: None, lambda: False)
    finally:
        made.stop()


HELD = """\
from pathlib import Path
from labcrane_view.settings import ViewSettings
from labcrane_view.screen.window import open_window

def sockets():
    links = [link for link in Path("/proc/self/fd").iterdir() if link.is_symlink()]
    return sum("socket:" in str(link.readlink()) for link in links)

window = open_window(ViewSettings(size=(160, 90), renderer="software"), "held")
output, before = window.output, sockets()
window.close()
print(before, sockets())
"""


def test_a_window_drawn_in_software_keeps_its_connection_for_who_still_refers_to_it() -> None:
    # Its destructor uses the connection; with none it may crash, or may not.
    done = subprocess.run([sys.executable, "-c", HELD], check=True, stdout=subprocess.PIPE)
    before, after = map(int, done.stdout.split())
    assert before == after
