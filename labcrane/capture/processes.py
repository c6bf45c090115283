"""All recordings of a visit: one process each, started again for as long as the session lasts."""

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

from labcrane.capture.config import CaptureConfig
from labcrane.processes.handle import Patience, ProcessHandle
from labcrane.session.visit import Visit
from labcrane.streams.request import StreamRequest

MODULE = "labcrane.capture.process"

START_S = 60.0
"""How long a device may take to open, and its process to load, on a busy computer."""

SILENT_S = 5.0
"""A process that has not reported for so long hangs, as a device's driver may: it is replaced."""

STOP_S = 10.0
PAUSE_S = 1.0
"""Between the end of a process and the start of the next one."""


class RecordingProcesses:
    """Starts, watches and stops the recordings of a visit."""

    def __init__(self, visit: Visit) -> None:
        required = _required(visit)
        self._handles = [_Handle(each, required[each.name]) for each in _configs(visit)]

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
    required = _required(visit)
    return [
        StreamRequest(each.name, source_id=each.stream_source, required=required[each.name])
        for each in _configs(visit)
    ]


def _configs(visit: Visit) -> list[CaptureConfig]:
    study = visit.study
    return [
        CaptureConfig(study.path.resolve(), study.recorded, name, visit.source, visit.journal)
        for name in study.recordings
    ]


def _required(visit: Visit) -> Mapping[str, bool]:
    """Return which recordings a session waits for; a simulated one waits for none."""
    chosen = visit.study.recordings.items()
    return {
        name: getattr(choice.settings, "required", True) and not visit.simulated
        for name, choice in chosen
    }


class _Handle(ProcessHandle):
    """The process of one recording, and what it last said."""

    def __init__(self, config: CaptureConfig, required: bool) -> None:  # noqa: FBT001
        self.sends = ""
        self._config, self._required = config, required
        self._file = self._failed = ""
        self._failures = self._missed = self._told = 0
        self._said: set[str] = set()
        self._again = math.inf
        self._left = False
        patience = Patience(START_S, SILENT_S, STOP_S)
        super().__init__(MODULE, f"recording {config.name}", patience, self._hear_of)
        self.start(config)

    @property
    def settled(self) -> bool:
        """Whether it records, or was seen to fail and is not required."""
        return self.ready or (self._failures > 0 and not self._required)

    def watch(self) -> list[str]:
        """Start it again some time after it failed; return what is new, in words."""
        news = []
        if self._again <= time.monotonic():
            self._again = math.inf
            self._failed = ""
            self._missed = self._told = 0
            self.start_anew(self._config)
        elif self._again == math.inf and (why := self.failure) is not None:
            self._left = (self.exit_code if self._left else self.kill()) is None
            if self._left:
                return self._fresh([self.stuck])
            self._failures += 1
            self.ready = False
            self._again = time.monotonic() + PAUSE_S
            news.append(f"failed: {self._failed or why}; it is tried again every {PAUSE_S:g} s")
        elif self.ready:
            news.append(f"is written to {self._file}")
        if self._missed >= 2 * max(self._told, 0.5):
            self._told = self._missed
            news.append(f"{self._missed} frames were dropped so far, by the device or here")
        return self._fresh(news)

    @property
    def stuck(self) -> str:
        """The words about a process that cannot be ended."""
        return (
            f"its process {self.pid} cannot be ended, as its driver waits for the device; unplug "
            "the device, or restart the computer after the session"
        )

    def _fresh(self, news: list[str]) -> list[str]:
        fresh = [each for each in news if each not in self._said]
        self._said |= {*fresh}
        return fresh

    def _hear_of(self, message: Mapping[str, Any]) -> None:
        self.sends = message.get("sends", self.sends)
        self._failed = message.get("failed", self._failed)
        self._missed = message.get("missed", self._missed)
        if "file" in message:
            self._file = message["file"]
            self._said = set()  # the same failure is news again
            self.ready = True
