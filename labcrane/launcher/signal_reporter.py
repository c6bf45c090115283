"""News of signals, from the recorder to the people and into the session's record."""

from collections.abc import Callable, Mapping
from typing import Any

from labcrane.session.commands import SignalReport
from labcrane.session.visit import Visit
from labcrane.streams.recorder.handle import RecorderHandle

Key = tuple[str, str, str]


class SignalReporter:
    """Tells what has gone wrong with a signal, or is well again, once.

    Parameters
    ----------
    say
        Tells people.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._told: dict[Key, str] = {}
        self._unwatched: list[str] = []

    def news(self, recorder: RecorderHandle) -> list[SignalReport]:
        """Return the changes since the last call, for the session, and report them to people."""
        if not recorder.status:  # it was restarted: nothing is known
            return []
        now, before = recorder.signals(), self._told
        self._told = now
        if (unwatched := recorder.unwatched()) != self._unwatched:
            self._unwatched = unwatched
            for line in unwatched:
                self._say(line)
        for key in now.keys() - before.keys():
            self._say(f"{_named(key)}: {key[2]}: {now[key]}")
        for key in before.keys() - now.keys():
            self._say(f"{_named(key)}: {key[2]} no more")
        bad = [SignalReport(*key, now[key], bad=True) for key in sorted(now.keys() - before)]
        good = [SignalReport(*key, "", bad=False) for key in sorted(before.keys() - now)]
        return bad + good


def _named(key: Key) -> str:
    return " ".join(part for part in key[:2] if part)


def monitor_config(visit: Visit) -> Mapping[str, Any] | None:
    """Return the monitors of a visit's streams; None where there are none."""
    study = visit.study
    if not study.protocol.streams or study.monitors == {}:
        return None
    chosen = study.monitors
    folder = study.path.parent
    use = None if chosen is None else [one.described(folder) for one in chosen.values()]
    return {"protocol": str(study.path), "machine": study.protocol.machine, "use": use}
