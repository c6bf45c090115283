"""Keys of a real terminal give orders."""

import io
import os
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from needs import needs
from programs import ran
from rehearsal import SHORT, simulated_file
from rich.console import Console

from labcrane import open_recording
from labcrane.cli.terminal import Terminal
from labcrane.core import Event, Item
from labcrane.design.counts import TrialCounts
from labcrane.testing import Command, Order, QueueConsole
from labcrane.web.translations import WORDS


class TerminalUser:
    """A person at a terminal: looks at what is printed, and presses keys."""

    def __init__(self, command: list[str], folder: Path) -> None:
        import pty

        self._keys, terminal = pty.openpty()
        self.process = subprocess.Popen(
            command, cwd=folder, stdin=terminal, stdout=terminal, stderr=terminal
        )
        os.close(terminal)
        self._seen = b""
        self._reader = threading.Thread(target=self._look, daemon=True)
        self._reader.start()

    def _look(self) -> None:
        while True:
            try:
                self._seen += os.read(self._keys, 4096)
            except OSError:  # the program has closed its terminal
                return

    def until(self, words: str) -> None:
        deadline = time.monotonic() + 240.0
        while words.encode() not in self._seen:
            assert time.monotonic() < deadline, f"{words!r} was not printed"
            time.sleep(0.01)

    def press(self, keys: str) -> None:
        os.write(self._keys, keys.encode())

    def leave(self) -> int:
        status = self.process.wait(240)
        self._reader.join()
        os.close(self._keys)
        return status


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A study whose operator is a recorded one, who is waited for like a person."""
    simulated_file(tmp_path, SHORT)
    recorded = "{use: recorded, file: data/P001-SIMULATED/P001-SIMULATED.h5}"
    (tmp_path / "study.yaml").write_text(
        SHORT.replace("{use: dual_joystick}", recorded), encoding="utf-8"
    )
    return tmp_path


def in_a_block(folder: Path) -> TerminalUser:
    """Start a pilot session, and its first block."""
    command = [sys.executable, "-m", "labcrane", "run", "study.yaml"]
    user = TerminalUser([*command, "--participant", "P002", "--local", "--pilot"], folder)
    user.until("space to start")
    user.press(" ")
    user.until("Block 1 began")
    return user


@pytest.mark.slow
@needs("terminals")
def test_keys_start_pause_note_flag_and_end_a_session(folder: Path) -> None:
    user = in_a_block(folder)
    user.press("p")
    user.until("Paused by you")
    user.press("nhustet zwei Malx\x7f, ächzt\n")
    user.press(" ")
    user.until("No longer paused by you")
    user.press("c1\n")
    user.press("z")  # no order: the keys are shown again
    user.press("e")
    assert user.leave() == 0
    session = open_recording(folder / "data" / "P002-PILOT" / "P002-PILOT.h5").session(1)
    given = {
        name: data["text"]
        for name, data in zip(session.events["name"], session.events["data"], strict=True)
        if name.startswith("order.")
    }
    assert given == {
        "order.start": "",
        "order.pause": "",
        "order.note": "hustet zwei Mal, ächzt",
        "order.completion": "1",
        "order.end": "",
    }


@pytest.mark.slow
@needs("terminals")
def test_an_interrupt_from_the_keyboard_ends_the_session_in_order(folder: Path) -> None:
    user = in_a_block(folder)
    user.process.send_signal(2)
    assert user.leave() == 0
    session = open_recording(folder / "data" / "P002-PILOT" / "P002-PILOT.h5").session(1)
    assert session.events["name"].tolist()[-1] == "session.end"
    assert session.events["data"].tolist()[-1]["reason"] == "by order"


FORMS = """page: {language: de}
questionnaires:
  q: {use: nasa_tlx, file: q.yaml}
  about: {use: demographics, language: de, ask: [sex, handedness]}
sessions:"""
TLX_DE = """\
rights: public domain
title: Belastung
left: gering
right: hoch
performance: [gut, schlecht]
pair: Was zählte mehr, {one} oder {other}?
items:
  - "Geistig: a"
  - "Körperlich: b"
  - "Zeitlich: c"
  - "Leistung: d"
  - "Anstrengung: e"
  - "Frust: f"
"""


@pytest.mark.parametrize("seed", range(20))
def test_a_prompt_shows_the_ends_of_a_scale_in_every_language(seed: int) -> None:
    random = Random(seed)
    low, steps, step = random.randint(-5, 5), random.randint(1, 50), random.choice([0.5, 1, 5])
    item = Item("a", "A?", "scale", low, low + steps * step, step, "gut", "schlecht")
    at = random.randint(0, steps)
    worded = replace(item, left="", words=((low + at * step, "mitten drin"),))
    for words in WORDS.values():
        said = words.takes(item)
        assert said.endswith(f": {low:g} gut, {low + steps * step:g} schlecht")
        assert f"{low + at * step:g} mitten drin" in words.takes(worded)
        refused = words.refused(item)
        assert f"{low:g} gut, " in refused


@pytest.mark.slow
@needs("terminals")
def test_the_terminal_asks_as_the_page_does_and_takes_the_labels_that_it_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")  # so that no prompt is broken into two lines
    (tmp_path / "q.yaml").write_text(TLX_DE, encoding="utf-8")
    study = SHORT.replace("sessions:", FORMS).replace(
        "{use: dual_joystick}", "{use: simulated_operator}"
    )
    study = study.replace("- block: {task: aiming, pairs: 1}", "- questionnaire: [q, about]")
    (tmp_path / "study.yaml").write_text(study, encoding="utf-8")
    command = [sys.executable, "-m", "labcrane", "run", "study.yaml", "--no-page"]
    user = TerminalUser([*command, "--participant", "P002", "--local", "--pilot"], tmp_path)
    user.until("Questionnaire shown: ")
    user.press("q")
    for ends in ("gering, 100 hoch",) * 3:
        user.until(f"0 bis 100 in Schritten von 5: 0 {ends}")
        user.press("90\r")
    user.until("0 bis 100 in Schritten von 5: 0 gut, 100 schlecht")
    user.press("101\r")
    user.until("Möglich ist 0 bis 100 in Schritten von 5: 0 gut, 100 schlecht")
    user.press("10\r5\r5\r")
    user.until("Questionnaire shown: Zu Ihrer Person")
    user.press("q")
    user.until("eines von weiblich")
    user.press("weiblich\r")
    user.until("Mit welcher Hand")
    user.press("\re")
    user.leave()
    answers = open_recording(tmp_path / "data/P002-PILOT/P002-PILOT.h5").session(1).questionnaires
    given = answers[answers["kind"] == "answer"].set_index("item")
    assert given["value"]["performance"] == 10.0
    assert given["text"]["sex"] == "female"


@pytest.mark.slow
@needs("terminals")
def test_a_questionnaire_is_filled_in_at_the_terminal(tmp_path: Path) -> None:
    steps = "- questionnaire: [subjective_accuracy, situational_awareness]"
    study = SHORT.replace("- block: {task: aiming, pairs: 1}", steps)
    study = study.replace("{use: dual_joystick}", "{use: simulated_operator}")
    (tmp_path / "study.yaml").write_text(study, encoding="utf-8")
    command = [sys.executable, "-m", "labcrane", "run", "study.yaml", "--no-page"]
    user = TerminalUser([*command, "--participant", "P002", "--local", "--pilot"], tmp_path)
    user.until("Questionnaire shown: Accuracy")
    user.press("q")
    user.until("- declines, empty leaves")
    user.press("11\r")
    user.until("Possible is 0 to 10")
    user.press("7\r")
    user.until("Questionnaire shown: Situational awareness")
    user.press("q-\r")
    assert user.leave() == 0
    table = open_recording(tmp_path / "data/P002-PILOT/P002-PILOT.h5").session(1).questionnaires
    scores = table[table["kind"] == "score"].set_index("questionnaire")["value"]
    assert scores["subjective_accuracy"] == 0.7
    assert scores.isna()["situational_awareness"]


class CountedLooks(threading.Event):
    """Tells each time that it is waited for."""

    def __init__(self) -> None:
        super().__init__()
        self.looks = threading.Semaphore(0)

    def wait(self, timeout: float | None = None) -> bool:
        self.looks.release()
        return super().wait(timeout)


@pytest.mark.parametrize("alone", [True, False], ids=["no page", "a page"])
def test_without_terminal_and_page_a_session_ends_where_it_waits(
    monkeypatch: pytest.MonkeyPatch, *, alone: bool
) -> None:
    monkeypatch.setattr("labcrane.cli.terminal.LOOK_S", 0.001)
    monkeypatch.setattr("labcrane.cli.terminal.PATIENCE_S", 0.01)
    console, printed = QueueConsole(), io.StringIO()
    terminal = Terminal(
        console, Console(file=printed, width=200), TrialCounts({}, {}), keys=True, alone=alone
    )
    terminal._over = over = CountedLooks()
    with (
        Path(os.devnull).open(encoding="utf-8") as nobody,
        monkeypatch.context() as patched,
    ):
        patched.setattr("sys.stdin", nobody)
        with terminal:
            for _ in range(100 if alone else 0):
                assert over.looks.acquire(timeout=60.0)
            assert not console.commands()  # a trial that runs would be run to its end
            console.report(Event("waiting", 1.0, {"what": "block 1"}))
            terminal._listener.join(60.0)
            assert not terminal._listener.is_alive()
            given = list(console.commands())
    assert given == ([Command(Order.END)] if alone else [])
    assert ("there is no page, so no action can be given" in printed.getvalue()) == alone


@pytest.mark.slow
def test_a_session_that_nobody_can_start_is_kept_to_be_gone_on_with(folder: Path) -> None:
    command = [sys.executable, "-m", "labcrane", "run", "study.yaml", "--no-page"]
    done = ran(
        [*command, "--participant", "P002", "--local", "--pilot"],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert "to continue, run: labcrane resume" in " ".join(done.stdout.split())
    session = open_recording(folder / "data" / "P002-PILOT" / "P002-PILOT.h5").session(1)
    assert session.events["data"].tolist()[-1]["reason"] == "by order"


def test_a_refused_order_is_called_as_it_is_given() -> None:
    console, printed = QueueConsole(), io.StringIO()
    refused = {"refused": "no trial is running", "text": "", "by": "terminal"}
    with Terminal(console, Console(file=printed), TrialCounts({}, {}), keys=False):
        console.report(Event("order.repeat", 1.0, refused))
    assert "Repeat was refused: no trial is running" in map(
        str.strip, printed.getvalue().splitlines()
    )


def test_a_line_is_short_and_says_nothing_of_what_is_not_known() -> None:
    from labcrane.cli.terminal import _trial_line, event_line

    ended = {"trial": 3, "outcome": "timeout", "movement_time": float("nan"), "error": 0.25}
    assert _trial_line(ended, TrialCounts({3: 1}, {})) == "trial 1 of 1: timeout, error 0.25 m"
    place = "dynamics 'slow' of plugin 'p', in step (/home/someone/a/b/slow.py:12), took 9 ms"
    slow = Event("plugin.slow", 0.0, {"why": place})
    assert event_line(slow, str) == (
        "Slow call: dynamics 'slow' of plugin 'p', in step (slow.py:12), took 9 ms"
    )
