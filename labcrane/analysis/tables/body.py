"""Heart rate and pupil during a movement, where a stream of another program sends them."""

from collections.abc import Sequence

import numpy as np

from labcrane.core.eyes import DescribedChannel, is_pupil
from labcrane.recording.participant_file.reader import SessionRecord, Stream
from labcrane.types import FloatArray

MEASURED = ("heart_rate", "pupil")

HEART_RATE = frozenset({"hr", "heartrate", "bpm"})
"""Labels and types of a channel of beats per minute, as belts and watches send it."""


class BodySignals:
    """The channels of a session that say how the body is.

    A measure is NaN where no stream has it, or several have: none is chosen silently.
    """

    def __init__(self, session: SessionRecord) -> None:
        self._signals: dict[str, tuple[FloatArray, FloatArray]] = {}
        for name, is_it in (("heart_rate", _is_heart_rate), ("pupil", is_pupil)):
            found = [
                (stream, labels)
                for stream in session.streams.values()
                if stream.header is not None
                and (labels := [each.label for each in stream.header.channels if is_it(each)])
            ]
            if len(found) == 1:
                self._signals[name] = found[0][0].time, _mean(*found[0])

    def measures(
        self, onset: float, offset: float, pauses: Sequence[tuple[float, float]] = ()
    ) -> dict[str, float]:
        """Return the mean of each from onset to offset, in s on our clock, without pauses."""
        found = {}
        for name in MEASURED:
            found[name] = float("nan")
            if name not in self._signals:
                continue
            time, values = self._signals[name]
            during = (time >= onset) & (time <= offset)
            for since, until in pauses:
                during &= (time < since) | (time >= until)
            own = values[during]
            own = own[np.isfinite(own)]
            if len(own):
                found[name] = float(own.mean())
        return found


def _mean(stream: Stream, labels: Sequence[str]) -> FloatArray:
    """Return the mean of channels in each sample; NaN where all are lost: a blink is 0."""
    columns = [np.asarray(stream.column(label), np.float64) for label in labels]
    known = [np.where(values > 0.0, values, np.nan) for values in columns]
    count = np.isfinite(known).sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.nansum(known, axis=0) / count)


def _is_heart_rate(channel: DescribedChannel) -> bool:
    said = (channel.label, channel.type)
    return any("".join(filter(str.isalpha, each.lower())) in HEART_RATE for each in said)
