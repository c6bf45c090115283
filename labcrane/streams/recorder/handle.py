"""Recorder processes that run for as long as a recording lasts: two write, two more wait.

Both write all streams, each into its own part of the journal, so that what is lost with one is in
the other (:mod:`labcrane.recording.overlap`). As many have loaded everything and wait: they take
over at once, even when both die in one moment.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from labcrane.processes.handle import Patience, ProcessHandle
from labcrane.recording.paths import part_number, parts
from labcrane.streams.recorder.process import STOP, RecorderConfig
from labcrane.streams.request import StreamRequest

MODULE = "labcrane.streams.recorder.process"

PATIENCE_S = 15.0
"""How long a recorder may take to close its journal when it is told to stop, or a spare to end."""

RECORDERS = 2
SPARES = 2


class RecorderHandle:
    """Starts the recorders, replaces one that dies, and knows what they last said.

    Attributes
    ----------
    restarts
        How many had to be replaced.
    """

    def __init__(self, journal: Path, requests: Sequence[StreamRequest]) -> None:
        self.restarts = 0
        self._journal = journal
        self._requests = tuple(requests)
        self._part = max((part_number(part) for part in parts(journal)), default=0)
        self._known: tuple[str, ...] = ()
        self._spares = [_Recorder() for _ in range(RECORDERS)]
        self._recorders = [self._began() for _ in range(RECORDERS)]

    @property
    def status(self) -> dict[str, Any]:
        """The last report of who has recorded longest; empty before any has spoken."""
        for recorder in self._recorders:
            if recorder.exit_code is None and recorder.status:
                return recorder.status
        return {}

    @property
    def ready(self) -> bool:
        """Whether everything that is required flows, and its clocks are sane."""
        return bool(self.status.get("ready"))

    def lost(self) -> set[str]:
        """Return the required streams that are not as they should be, by the study's names."""
        return {
            stream["label"]
            for stream in self.status.get("streams", ())
            if stream["required"] and not stream["sane"]
        }

    def complaints(self) -> list[str]:
        """Return what is not as it should be, one line for each complaint."""
        lines = [f"recorder: {fault}" for fault in self.status.get("faults", ())]
        for stream in self.status.get("streams", ()):
            lines += [f"{stream['label']}: {warning}" for warning in stream["warnings"]]
            lines += [f"{stream['label']}: {misfit}" for misfit in stream["misfits"]]
            if not (stream["sane"] or stream["warnings"] or stream["misfits"]):
                lines.append(f"{stream['label']}: {stream['condition']}")
        return list(dict.fromkeys(lines))

    def watch(self) -> bool:
        """Replace recorders that have died; whether one had."""
        for spare in [one for one in self._spares if one.exit_code is not None]:
            spare.kill()
            self._spares.remove(spare)
        dead = [one for one in self._recorders if one.exit_code is not None]
        for recorder in dead:
            recorder.kill()
            self.restarts += 1
            self._known = tuple(recorder.status.get("known", self._known))
            self._recorders.remove(recorder)
            self._recorders.append(self._began())
        if self.status and len(self._spares) < SPARES:  # not while everything else is started
            self._spares.append(_Recorder())
        return bool(dead)

    def stop(self) -> None:
        """Let the recorders write down what has come and close their journals."""
        for recorder in self._recorders:
            recorder.tell(STOP)
        deadline = time.monotonic() + PATIENCE_S
        for recorder in (*self._recorders, *self._spares):
            recorder.stop(max(deadline - time.monotonic(), 1.0))

    def _began(self) -> "_Recorder":
        """Give a recorder that waits its orders."""
        recorder = self._spares.pop(0) if self._spares else _Recorder()
        self._part += 1
        recorder.tell(
            RecorderConfig(self._journal, self._requests, part=self._part, known=self._known)
        )
        return recorder


class _Recorder(ProcessHandle):
    """A recorder process that waits for its orders, and what it last said."""

    def __init__(self) -> None:
        self.status: dict[str, Any] = {}
        super().__init__(MODULE, "recorder", Patience(stop_s=PATIENCE_S), self._hear_of)
        self.start()

    def _hear_of(self, status: dict[str, Any]) -> None:
        self.status = status
