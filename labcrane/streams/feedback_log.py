"""Feedback log: what was presented, and when, as streams that the recorder takes.

``labcrane.feedback.<name>`` has a sample for every frame presented: the tick of that frame and when
it was due, how many newer ones replaced others unseen so far, and the component's signals. Its
time is when the component had presented it. A component's further streams come beside it, with
the same tick and time: ``labcrane.feedback.<name>.<stream>``.
"""

import time
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from labcrane.core.records import Frame
from labcrane.core.roles import Feedback
from labcrane.core.signals import Layout
from labcrane.recording.pictures import LOG
from labcrane.streams.outlets import SampleOutlet, channel, source_id, stream_info
from labcrane.types import FloatArray

HEAD = (("frame.tick", "1"), ("frame.due", "s"), ("frame.skipped", "1"))


def log_name(name: str, stream: str = "") -> str:
    """Return the name of the stream in which feedback ``name`` says what it presented."""
    return f"{LOG}{name}" + (f".{stream}" if stream else "")


def log_source(source: str, name: str, stream: str = "") -> str:
    """Return that stream's source id, which is known before it exists."""
    return source_id(source, log_name(name, stream))


class Logged(Protocol):
    """What presents, as far as its log goes."""

    @property
    def layout(self) -> Layout: ...
    @property
    def feedback(self) -> Feedback: ...


class FeedbackLog:
    """The streams of one feedback process."""

    def __init__(self, name: str, source: str, presenter: Logged) -> None:
        extra = {
            stream: Layout(stream, signals)
            for stream, signals in presenter.feedback.streams.items()
        }
        self._samples = {
            stream: self._open(log_name(name, stream), source, layout)
            for stream, layout in {"": presenter.layout, **extra}.items()
        }

    @property
    def taken(self) -> bool:
        """Whether all of its streams have a receiver: samples without one are lost."""
        return all(samples.taken for samples in self._samples.values())

    @property
    def descriptions(self) -> list[str]:
        """Its streams as XML: who has them needs no search."""
        return [samples.description for samples in self._samples.values()]

    def push(
        self, frame: Frame, values: FloatArray, skipped: int, more: Mapping[str, FloatArray]
    ) -> float:
        """Write down that ``frame`` has been presented, now; return what time that is."""
        now = time.perf_counter()
        head = (frame.tick.number, frame.tick.due, skipped)
        for stream, array in {"": values, **more}.items():
            for row in np.atleast_2d(array):
                self._samples[stream].push(np.concatenate([head, row]), now)
        return now

    def close(self) -> None:
        """End the streams."""
        for samples in self._samples.values():
            samples.close()

    def _open(self, name: str, source: str, layout: Layout) -> SampleOutlet:
        info = stream_info(
            name,
            "Feedback",
            len(HEAD) + layout.size,
            "double64",
            rate_hz=0.0,
            source=source,
        )
        for label, unit in (*HEAD, *zip(layout.columns, layout.units, strict=True)):
            channel(info, label=label, unit=unit, type="Feedback")
        return SampleOutlet(info, len(HEAD) + layout.size)
