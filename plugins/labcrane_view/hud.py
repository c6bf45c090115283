"""The text in the corner, in the operator's language."""

import math
from collections.abc import Mapping, Sequence

from labcrane import Frame, Situation

WORDS: Mapping[str, Mapping[str, str]] = {
    "en": {
        "block": "Block",
        "trial": "Trial",
        "distance": "Distance",
        "time": "Time",
        "speed": "Tip speed",
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
        "lateness": "Opóźnienie",
        "paused": "PAUZA",
        "practice": "trening",
    },
}


def hud_lines(
    wanted: Sequence[str],
    language: str,
    frame: Frame,
    situation: Situation,
    distance: float,
    speed: float,
) -> list[str]:
    """Return the lines to be shown; ``distance`` in m and ``speed`` in m/s, NaN for unknown."""
    words = WORDS[language]
    of = f" / {situation.trials}" if situation.trials else ""
    practice = f" ({words['practice']})" if situation.practice else ""
    lines = {
        "block": f"{words['block']} {situation.block}: {situation.block_name}{practice}"
        if situation.block
        else "",
        "trial": f"{words['trial']} {frame.trial}{of}" if frame.trial else "",
        "distance": "" if math.isnan(distance) else f"{words['distance']} {distance:.2f} m",
        "time": f"{words['time']} {frame.elapsed:.1f} s" if frame.trial else "",
        "speed": "" if math.isnan(speed) else f"{words['speed']} {speed:.2f} m/s",
        "lateness": f"{words['lateness']} {1000 * (frame.tick.woke - frame.tick.due):.2f} ms",
    }
    shown = [lines[name] for name in wanted if lines[name]]
    return [*shown, words["paused"]] if frame.paused and wanted else shown
