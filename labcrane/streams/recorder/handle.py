"""Recorder processes that run for as long as a recording lasts: two write, two more wait.

Both write all streams, each into its own part of the journal, so that what is lost with one is in
the other (:mod:`labcrane.recording.overlap`). As many have loaded everything and wait: they take
over at once, even when both die in one moment.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from labcrane.processes.handle import Patience, ProcessHandle
from labcrane.recording.paths import part_number, parts
from labcrane.streams.recorder.candidates import answered, called
from labcrane.streams.recorder.process import CONFIRMED, KNOWN, STOP, RecorderConfig
from labcrane.streams.request import NOBODY, StreamRequest

MODULE = "labcrane.streams.recorder.process"

PATIENCE_S = 15.0
"""How long a recorder may take to close its journal when it is told to stop, or a spare to end."""

SILENT_S = 10.0
"""A recorder that has not reported for so long may hang: its last report is not used."""

OF_SIGNALS = ("signals", "unwatched")
"""What of a stream's status only the recorder beside the monitors knows."""

RECORDERS = 2
SPARES = 2


class RecorderHandle:
    """Starts the recorders, replaces one that dies, and knows what they last said.

    Attributes
    ----------
    restarts
        How many had to be replaced.

    Parameters
    ----------
    journal, requests
        Where the streams go, and which.
    monitors
        What looks at their signals, as of :class:`labcrane.monitoring.config.MonitorConfig`: beside
        one of the recorders, for all see the same. None for nothing.
    """

    def __init__(
        self,
        journal: Path,
        requests: Sequence[StreamRequest],
        monitors: Mapping[str, Any] | None = None,
    ) -> None:
        self.restarts = 0
        self._journal = journal
        self._requests = tuple(requests)
        self._monitors = monitors
        self._monitoring: _Recorder | None = None
        self._recorders: list[_Recorder] = []
        self._part = max((part_number(part) for part in parts(journal)), default=0)
        self._known: tuple[str, ...] = ()
        self._offered: tuple[str, ...] = ()
        self._spares = [_Recorder() for _ in range(RECORDERS)]
        for _ in range(RECORDERS):
            self._recorders.append(self._began())

    @property
    def status(self) -> dict[str, Any]:
        """The last report of who has recorded longest; empty before any has spoken.

        It is empty, too, when all that have spoken are silent.
        """
        for recorder in self._recorders:
            if recorder.exit_code is None and recorder.status and recorder.silent_s < SILENT_S:
                return recorder.status | {"streams": self._with_signals(recorder.status)}
        return {}

    def _with_signals(self, status: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Return a recorder's streams with what the one beside the monitors knows of them."""
        monitoring = self._monitoring.status if self._monitoring else {}
        known = {_key(stream): stream for stream in monitoring.get("streams", ())}
        return [
            stream | {name: known.get(_key(stream), stream)[name] for name in OF_SIGNALS}
            for stream in status.get("streams", ())
        ]

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
        if all(one.status and one.silent_s >= SILENT_S for one in self._recorders):
            silent = f"none has responded for over {SILENT_S:g} s"
            return [f"recorder: {silent}; check the disk of the data folder"]
        lines = [f"recorder: {fault}" for fault in self.status.get("faults", ())]
        for stream in self.status.get("streams", ()):
            lines += [f"{stream['label']}: {warning}" for warning in stream["warnings"]]
            lines += [f"{stream['label']}: {misfit}" for misfit in stream["misfits"]]
            if not (stream["sane"] or stream["warnings"] or stream["misfits"]):
                lines.append(f"{stream['label']}: {stream['condition']}")
        return list(dict.fromkeys(lines))

    @property
    def asks(self) -> bool:
        """Whether a stream of a type needs confirmation."""
        return any(stream["candidates"] for stream in self.status.get("streams", ()))

    def confirm(self, text: str) -> tuple[str, str]:
        """Record the confirmed stream of a type.

        ``text`` is read by :func:`labcrane.streams.recorder.candidates.answered`. Returns the
        study's name for it, and in words which it is.

        Raises
        ------
        StreamError
            It answers no question.
        """
        label, meant = answered(text, self.status.get("streams", ()))
        self._requests = tuple(
            replace(one, confirmed=meant) if one.label == label else one for one in self._requests
        )
        for recorder in self._recorders:
            recorder.tell({CONFIRMED: {label: meant}})
        return label, "none of them" if meant == NOBODY else called(meant)

    def taken(self) -> list[str]:
        """Return which streams were confirmed that only their type asked for, one line each."""
        streams = self.status.get("streams", ())
        return [f"{one['label']}: {one['taken']}" for one in streams if one["taken"]]

    def signals(self) -> dict[tuple[str, str, str], str]:
        """Return what is wrong with signals: the message by stream, channel and kind of fault.

        Streams have the study's names; the channel is empty for a whole stream.
        """
        return {
            (stream["label"], fault["channel"], fault["kind"]): fault["message"]
            for stream in self.status.get("streams", ())
            for fault in stream["signals"]
        }

    def unwatched(self) -> list[str]:
        """Return which monitors look no more, one line for each."""
        died = self._monitoring.status.get("monitors") if self._monitoring else None
        lines = [died] if died else []
        for stream in self.status.get("streams", ()):
            lines += [
                f"{stream['label']}: monitor {name!r} was left out: {why}"
                for name, why in stream["unwatched"].items()
            ]
        return lines

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

    def offer(self, streams: Sequence[str]) -> None:
        """Tell the recorders of streams on this computer, by description: they need no search."""
        if new := [one for one in streams if one not in self._offered]:
            self._offered += tuple(new)
            for recorder in self._recorders:
                recorder.tell({KNOWN: new})

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
        monitors = None
        if self._monitors is not None and self._monitoring not in self._recorders:
            self._monitoring, monitors = recorder, self._monitors
        recorder.tell(
            RecorderConfig(
                self._journal,
                self._requests,
                part=self._part,
                known=(*self._offered, *self._known),
                monitors=monitors,
            )
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


def _key(stream: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(str(stream[name]) for name in ("label", "name", "type", "source_id", "channels"))
