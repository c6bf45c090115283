"""All estimates of a visit: one process each, started again for as long as the session lasts."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from labcrane.core.by_estimate import OF_ESTIMATE
from labcrane.processes.handle import Patience
from labcrane.processes.restarted import RestartedProcess
from labcrane.recording.own_streams import ESTIMATED
from labcrane.session.commands import EstimateFailed
from labcrane.session.part import PartConfig
from labcrane.session.visit import Visit
from labcrane.streams.outlets import source_id
from labcrane.streams.request import StreamRequest

MODULE = "labcrane.estimation.process"

START_S, SILENT_S, STOP_S = 60.0, 5.0, 5.0
"""How long a process may take to begin, may be silent then, and may take to end."""

LONGEST_PAUSE_S = 30.0

PROPERTIES = {"name": "name", "type": "type", "source_id": "source_id", "hostname": "host"}
"""What a stream is found by, and what the recorder's status calls it."""


class EstimateProcesses:
    """Starts, watches and stops the estimates of a visit."""

    def __init__(self, visit: Visit) -> None:
        self._handles = [
            _Handle(PartConfig.of(visit, name), settings.stream)
            for name, settings in visit.study.estimates.items()
        ]

    @property
    def settled(self) -> bool:
        """Whether the stream of each is there, or its process has failed once."""
        return all(handle.sends or handle.failures for handle in self._handles)

    @property
    def sends(self) -> tuple[str, ...]:
        """The descriptions of the streams of values."""
        return tuple(handle.sends for handle in self._handles if handle.sends)

    def watch(
        self, streams: Sequence[Mapping[str, Any]], say: Callable[[str], None]
    ) -> list[EstimateFailed]:
        """Start those again that have failed, and tell all which streams the recorder has.

        Returns what the session is to record: why they have failed.
        """
        failed = []
        taken = {
            each["label"]: {key: each[own] for key, own in PROPERTIES.items()}
            for each in streams
            if each["name"]
        }
        for handle in self._handles:
            for news in handle.watch():
                say(f"{handle.name}: {news}")
                failed.append(EstimateFailed(handle.estimate, news))
            handle.follow(taken)
        return failed

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


class _Handle(RestartedProcess):
    """The process of one estimate, and the stream that it receives."""

    def __init__(self, config: PartConfig, stream: str) -> None:
        self._stream, self.estimate = stream, config.name
        self._told: Mapping[str, str] | None = None
        patience = Patience(START_S, SILENT_S, STOP_S)
        super().__init__(MODULE, f"estimate {config.name}", patience, config, LONGEST_PAUSE_S)

    def follow(self, taken: Mapping[str, Mapping[str, str]]) -> None:
        """Tell the present process which stream the recorder has."""
        stream = taken.get(self._stream)
        if stream is not None and stream != self._told:
            self._told = stream
            self.tell(stream)

    def start_anew(self, order: object) -> None:
        self._told = None
        super().start_anew(order)

    def _hear_of(self, message: Mapping[str, Any]) -> None:
        super()._hear_of(message)
        if "beat" in message and not self.ready:
            self._works()
