"""The text in the corner, in the operator's language."""

import math
import re
from collections.abc import Mapping, Sequence

from labcrane import Frame, Run
from labcrane.core import SessionState, TargetFinder

LOAD = "joint.load"
PEOPLE = {"examiner", "stop rule"}
"""Who can pause a session; any other name is that of a lost component."""

ITEM = re.compile(r"([-*+•]|\d+[.)])\s")

LANGUAGES = ("en", "de", "pl")
TABLE = (
    ("block", "Block", "Block", "Blok"),
    ("trial", "Trial", "Durchgang", "Próba"),
    ("distance", "Distance", "Abstand", "Odległość"),
    ("time", "Time", "Zeit", "Czas"),
    ("speed", "Tip speed", "Tempo der Spitze", "Prędkość końcówki"),
    ("load", "Load", "Last", "Obciążenie"),
    ("lateness", "Late", "Verspätung", "Opóźnienie"),
    ("paused", "PAUSED", "PAUSE", "PAUZA"),
    ("fault", "FAULT", "STÖRUNG", "AWARIA"),
    ("wait", "WAIT", "WARTEN", "CZEKAJ"),
    ("done", "DONE", "FERTIG", "KONIEC"),
    ("practice", "practice", "Übung", "trening"),
    (
        "questions",
        "Please answer the questions now:",
        "Bitte jetzt die Fragen beantworten:",
        "Proszę teraz odpowiedzieć na pytania:",
    ),
)
"""A word or sentence a row: its name, and how it is in each of the languages."""

WORDS: Mapping[str, Mapping[str, str]] = {
    language: {row[0]: row[at] for row in TABLE} for at, language in enumerate(LANGUAGES, 1)
}


class Hud:
    """Shows the state of trial and session in words.

    Parameters
    ----------
    wanted
        Names of the lines, as in the settings.
    """

    def __init__(self, wanted: Sequence[str], language: str, run: Run) -> None:
        self._wanted, self._words = wanted, WORDS[language]
        self._tip = run.state.find("tip.position")
        self._speed = run.state.find("tip.velocity")
        loads = [signal for signal in run.state.signals if signal.name == LOAD]
        self._joints = loads[0].components if loads else ()
        self._load = run.state.find(LOAD) if loads else slice(0)
        self._targets = TargetFinder(run.task)

    def lines(self, frame: Frame, situation: SessionState) -> list[str]:
        """Return the lines to be shown; one that has nothing to say is left out."""
        words = self._words
        practice = f" ({words['practice']})" if situation.practice else ""
        there = next(self._targets.find(frame.task), None)
        away = math.dist(frame.state[self._tip], there.centre) if there else 0.0
        speed = math.dist(frame.state[self._speed], (0.0, 0.0, 0.0))
        loads = zip(self._joints, frame.state[self._load].tolist(), strict=True)
        working = "  ".join(f"{joint} {100 * load:.0f} %" for joint, load in loads)
        lines = {
            "block": f"{words['block']} {situation.block}: {situation.block_name}{practice}"
            if situation.block
            else "",
            "trial": f"{words['trial']} {situation.counted} / {situation.trials}"
            if situation.counted
            else "",
            "distance": f"{words['distance']} {away:.2f} m" if there else "",
            "time": f"{words['time']} {frame.elapsed:.1f} s" if frame.trial else "",
            "speed": f"{words['speed']} {speed:.2f} m/s",
            "load": f"{words['load']} {working}" if working else "",
            "lateness": f"{words['lateness']} {1000 * (frame.tick.woke - frame.tick.due):.2f} ms",
        }
        return [lines[name] for name in self._wanted if lines[name]]


def notice(frame: Frame, situation: SessionState, hint_s: float, language: str) -> list[str]:
    """Return what the operator is to read now: the step's text, and a hint that is still new."""
    fresh = 0.0 <= frame.tick.due - situation.hint_time < hint_s
    asked = situation.questionnaire
    text = f"{WORDS[language]['questions']}\n{asked}" if asked else unwrapped(situation.text)
    return [text for text in (text, situation.hint if fresh else "") if text]


def standing(frame: Frame, situation: SessionState) -> str:
    """Return why the operator must not move, as a name in ``WORDS``; empty while they may.

    Text stays legible: nothing covers the picture only because the session waits for its reader.
    """
    if situation.over:
        return "done"
    if frame.paused:
        return "fault" if set(situation.held) - PEOPLE else "paused"
    reads = situation.text or situation.questionnaire
    return "wait" if situation.waiting and not reads else ""


def unwrapped(text: str) -> str:
    """Return text without the line breaks of its file, so that the view can wrap it.

    Paragraphs and the items of a list stay separate.
    """
    kept: list[str] = []
    for line in map(str.strip, text.strip().splitlines()):
        goes_on = kept and kept[-1] and line and not ITEM.match(line)
        if goes_on:
            kept[-1] += f" {line}"
        else:
            kept.append(line)
    return "\n".join(kept)
