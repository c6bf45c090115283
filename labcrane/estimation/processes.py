"""All estimates of a visit: one process each, started again for as long as the session lasts."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from labcrane.core.by_estimate import OF_ESTIMATE
from labcrane.estimation.config import EstimateConfig
from labcrane.processes.handle import Patience, ProcessHandle
from labcrane.recording.own_streams import ESTIMATED
from labcrane.session.visit import Visit
from labcrane.streams.outlets import source_id
from labcrane.streams.request import StreamRequest

MODULE = "labcrane.estimation.process"

START_S, SILENT_S, STOP_S = 60.0, 5.0, 5.0
"""How long a process may take to begin, may be silent then, and may take to end."""

PAUSE_S, LONGEST_PAUSE_S = 1.0, 30.0
"""Between the end of a process and the start of the next one; each pause is twice the last."""

PROPERTIES = {"name": "name", "type": "type", "source_id": "source_id", "hostname": "host"}
"""What a stream is found by, and what the recorder's status calls it."""


class EstimateProcesses:
    """Starts, watches and stops the estimates of a visit."""

    def __init__(self, visit: Visit) -> None:
        study = visit.study
        self._handles = [
            _Handle(EstimateConfig(study.path.resolve(), study.recorded, name, visit.source), of)
            for name, of in ((name, each.stream) for name, each in study.estimates.items())
        ]

    @property
    def settled(self) -> bool:
        """Whether the stream of each is there, or its process has failed once."""
        return all(handle.sends or handle.restarts for handle in self._handles)

    @property
    def sends(self) -> tuple[str, ...]:
        """The descriptions of the streams of values."""
        return tuple(handle.sends for handle in self._handles if handle.sends)

    def watch(self, streams: Sequence[Mapping[str, Any]], say: Callable[[str], None]) -> None:
        """Start those again that have failed, and tell all which streams the recorder has."""
        taken = {
            each["label"]: {key: each[own] for key, own in PROPERTIES.items()}
            for each in streams
            if each["name"]
        }
        for handle in self._handles:
            if news := handle.watch(taken):
                say(news)

    def stop(self) -> None:
        """Stop all processes."""
        for handle in self._handles:
            handle.stop()


def estimate_requests(visit: Visit) -> list[StreamRequest]:
    """Return the requests to the recorder: the streams of values."""
    return [
        StreamRequest(
            OF_ESTIMATE + name, source_id=source_id(visit.source, ESTIMATED + name), required=False
        )
        for name in visit.study.estimates
    ]


class _Handle(ProcessHandle):
    """The process of one estimate, the stream that it receives and the one that it sends."""

    def __init__(self, config: EstimateConfig, stream: str) -> None:
        self._config, self._stream = config, stream
        self._told: Mapping[str, str] | None = None
        self._failed = self.sends = ""
        self._again: float | None = None
        self._pause_s = PAUSE_S
        patience = Patience(START_S, SILENT_S, STOP_S)
        super().__init__(MODULE, f"estimate {config.name}", patience, self._hear_of)
        self.start(config)

    def watch(self, taken: Mapping[str, Mapping[str, str]]) -> str:
        """Start it again some time after it failed; return what is new, in words."""
        if self._again is not None:
            if time.monotonic() >= self._again:
                self._again = None
                self.start_anew(self._config)
            return ""
        if (why := self.failure) is not None:
            self.kill()
            self.ready, self._told = False, None
            self._again = time.monotonic() + self._pause_s
            self._pause_s = min(2.0 * self._pause_s, LONGEST_PAUSE_S)
            news = f"{self.name} failed: {self._failed or why}; it is started again"
            self._failed = self.sends = ""
            return news
        stream = taken.get(self._stream)
        if stream is not None and stream != self._told:
            self._told = stream
            self.tell(stream)
        return ""

    def _hear_of(self, message: Mapping[str, Any]) -> None:
        self._failed = message.get("failed", self._failed)
        self.sends = message.get("sends", self.sends)
        self.ready = self.ready or "beat" in message
