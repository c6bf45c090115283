"""The text in the corner, in the operator's language."""

import math
from collections.abc import Mapping, Sequence

from labcrane import Frame, Run, Situation, Targets

LOAD = "joint.load"

WORDS: Mapping[str, Mapping[str, str]] = {
    "en": {
        "block": "Block",
        "trial": "Trial",
        "distance": "Distance",
        "time": "Time",
        "speed": "Tip speed",
        "load": "Load",
        "lateness": "Late",
        "paused": "PAUSED",
        "practice": "practice",
    },
    "de": {
        "block": "Block",
        "trial": "Durchgang",
        "distance": "Abstand",
        "time": "Zeit",
        "speed": "Tempo der Spitze",
        "load": "Last",
        "lateness": "Verspätung",
        "paused": "PAUSE",
        "practice": "Übung",
    },
    "pl": {
        "block": "Blok",
        "trial": "Próba",
        "distance": "Odległość",
        "time": "Czas",
        "speed": "Prędkość końcówki",
        "load": "Obciążenie",
        "lateness": "Opóźnienie",
        "paused": "PAUZA",
        "practice": "trening",
    },
}


class Hud:
    """Says in words how things stand.

    Parameters
    ----------
    wanted
        Which lines, by their names in the settings.
    """

    def __init__(self, wanted: Sequence[str], language: str, run: Run) -> None:
        self._wanted, self._words = wanted, WORDS[language]
        self._tip = run.state.find("tip.position")
        self._speed = run.state.find("tip.velocity")
        loads = [signal for signal in run.state.signals if signal.name == LOAD]
        self._joints = loads[0].components if loads else ()
        self._load = run.state.find(LOAD) if loads else slice(0)
        self._targets = Targets(run.task)

    def lines(self, frame: Frame, situation: Situation) -> list[str]:
        """Return the lines to be shown; one that has nothing to say is left out."""
        words = self._words
        of = f" / {situation.trials}" if situation.trials else ""
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
            "trial": f"{words['trial']} {frame.trial}{of}" if frame.trial else "",
            "distance": f"{words['distance']} {away:.2f} m" if there else "",
            "time": f"{words['time']} {frame.elapsed:.1f} s" if frame.trial else "",
            "speed": f"{words['speed']} {speed:.2f} m/s",
            "load": f"{words['load']} {working}" if working else "",
            "lateness": f"{words['lateness']} {1000 * (frame.tick.woke - frame.tick.due):.2f} ms",
        }
        shown = [lines[name] for name in self._wanted if lines[name]]
        return [*shown, words["paused"]] if frame.paused and self._wanted else shown


def notice(frame: Frame, situation: Situation, hint_s: float) -> list[str]:
    """Return what the operator is to read now: the step's text, and a hint that is still new."""
    fresh = 0.0 <= frame.tick.due - situation.hint_time < hint_s
    return [text for text in (situation.text, situation.hint if fresh else "") if text]
