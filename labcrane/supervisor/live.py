"""Signals of machine and scenario, from the session's LSL streams."""

import threading
import time
from collections import deque
from collections.abc import Mapping
from typing import Any

from labcrane.streams.outlets import INPUT, STATE

HISTORY_S = 20.0
CHART_HZ = 20.0
PAUSE_S = 0.02


class Live:
    """Keeps the newest sample of every signal, and some seconds of history for charts.

    A thread pulls; whoever reads gets what there is. Streams are found again when a session is.

    Attributes
    ----------
    newest
        The newest value of each signal by its column.
    age_s
        How old the newest frame was when it came, in seconds.
    """

    def __init__(self, source: str) -> None:
        self.newest: dict[str, float] = {}
        self.age_s: float | None = None
        self._source = source
        self._history: deque[tuple[float, dict[str, float]]] = deque(
            maxlen=round(HISTORY_S * CHART_HZ)
        )
        threading.Thread(target=self._pull, name="live", daemon=True).start()

    def history(self, signal: str) -> list[tuple[float, float]]:
        """Return times in seconds before now and values of a signal, oldest first."""
        kept = list(self._history)
        end = kept[-1][0] if kept else 0.0
        return [(round(t - end, 3), values[signal]) for t, values in kept if signal in values]

    def _pull(self) -> None:
        import pylsl  # noqa: PLC0415

        inlets: Mapping[str, tuple[Any, list[str]]] = {}
        while True:
            missing = [name for name in (STATE, INPUT) if name not in inlets]
            inlets = {**inlets, **{n: found for n in missing if (found := self._open(n))}}
            for inlet, columns in inlets.values():
                samples, stamps = inlet.pull_chunk(timeout=0.0, max_samples=1024)
                if stamps:
                    self.newest.update(zip(columns, samples[-1], strict=True))
                    self.age_s = pylsl.local_clock() - stamps[-1]
                    self._keep(stamps[-1])
            time.sleep(PAUSE_S)

    def _open(self, name: str) -> "tuple[Any, list[str]] | None":
        import pylsl  # noqa: PLC0415

        wanted = f"source_id='labcrane/{self._source}/{name}'"
        found = pylsl.resolve_bypred(wanted, 1, 0.5)
        if not found:
            return None
        # One second of buffer, and a connection that comes back by itself.
        inlet = pylsl.StreamInlet(found[0], max_buflen=1, recover=True)
        channel = inlet.info(5.0).desc().child("channels").child("channel")
        columns = []
        while not channel.empty():
            columns.append(channel.child_value("label"))
            channel = channel.next_sibling("channel")
        return inlet, columns

    def _keep(self, stamp: float) -> None:
        if not self._history or stamp - self._history[-1][0] >= 1.0 / CHART_HZ:
            self._history.append((stamp, dict(self.newest)))
