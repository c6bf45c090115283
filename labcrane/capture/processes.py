"""All recordings of a visit: one process each, started again for as long as the session lasts."""

from collections.abc import Callable, Mapping
from typing import Any

from labcrane.processes.handle import Patience
from labcrane.processes.restarted import RestartedProcess
from labcrane.recording.pictures import CAPTURED
from labcrane.session.part import PartConfig
from labcrane.session.visit import Visit
from labcrane.streams.outlets import source_id
from labcrane.streams.request import StreamRequest

MODULE = "labcrane.capture.process"

START_S = 60.0
"""How long a device may take to open, and its process to load, on a busy computer."""

SILENT_S = 5.0
"""A process that has not reported for so long hangs, as a device's driver may: it is replaced."""

STOP_S = 10.0


class RecordingProcesses:
    """Starts, watches and stops the recordings of a visit."""

    def __init__(self, visit: Visit) -> None:
        self._handles = [
            _Handle(PartConfig.of(visit, name), required=required)
            for name, required in _required(visit).items()
        ]

    @property
    def settled(self) -> bool:
        """Whether all that are required record, and the others do or have failed once.

        A device that is not there is waited for, as a required stream is.
        """
        return all(handle.settled for handle in self._handles)

    def watch(self, say: Callable[[str], None]) -> None:
        """Start those again that have failed, and say what is new."""
        for handle in self._handles:
            for news in handle.watch():
                say(f"{handle.name}: {news}")

    @property
    def sends(self) -> tuple[str, ...]:
        """The descriptions of the streams that list their frames."""
        return tuple(handle.sends for handle in self._handles if handle.sends)

    def stop(self, say: Callable[[str], None]) -> None:
        """Let all end their files, and say which cannot be ended."""
        for handle in self._handles:
            if handle.stop() is None:
                say(f"{handle.name}: {handle.stuck}")


def index_requests(visit: Visit) -> list[StreamRequest]:
    """Return the requests to the recorder: the lists of frames."""
    return [
        StreamRequest(name, source_id=source_id(visit.source, CAPTURED + name), required=required)
        for name, required in _required(visit).items()
    ]


def _required(visit: Visit) -> Mapping[str, bool]:
    """Return which recordings a session waits for; a simulated one waits for none."""
    chosen = visit.study.recordings.items()
    return {
        name: getattr(choice.settings, "required", True) and not visit.simulated
        for name, choice in chosen
    }


class _Handle(RestartedProcess):
    """The process of one recording, its file and the frames that it lacks."""

    def __init__(self, config: PartConfig, *, required: bool) -> None:
        self._required = required
        self._file = ""
        self._missed = self._told = 0
        patience = Patience(START_S, SILENT_S, STOP_S)
        super().__init__(MODULE, f"recording {config.name}", patience, config)

    @property
    def settled(self) -> bool:
        """Whether it records, or was seen to fail and is not required."""
        return self.ready or (self.failures > 0 and not self._required)

    def _news(self) -> list[str]:
        news = super()._news()
        if self.ready:
            news.append(f"is written to {self._file}")
        if self._missed >= 2 * max(self._told, 0.5):
            self._told = self._missed
            news.append(f"{self._missed} frames were dropped so far, by the device or here")
        return news

    def _hear_of(self, message: Mapping[str, Any]) -> None:
        super()._hear_of(message)
        self._missed = message.get("missed", self._missed)
        if "file" in message:
            self._file, self._missed, self._told = message["file"], 0, 0
            self._works()
