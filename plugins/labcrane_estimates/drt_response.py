"""The response time of a detection response task, from the codes of its events."""

import math
from collections import deque

from labcrane import Estimate, FloatArray, StreamError
from labcrane.core import Estimated, SignalStream
from labcrane_estimates.settings import DrtResponseSettings

CODE = "code"
STIMULUS, RESPONSE, OUTCOME = 112, 113, 114
"""Codes of the events of the task (docs/markers.md); a code never changes its meaning."""

SOON_S = 0.1
"""The outcome comes in the first tick after the time for a response. One that comes at another time
is of a stimulus that an interruption ended, which does not count."""


class DrtResponse(Estimate):
    """Gives the mean response time of the window's hits; NaN where there are none."""

    def __init__(self, settings: DrtResponseSettings) -> None:
        self._settings = settings

    def begin(self, stream: SignalStream) -> None:
        labels = [each.label for each in stream.channels]
        if CODE not in labels:
            raise StreamError(
                f"stream {stream.name!r} has no channel {CODE!r}; give the stream labcrane.codes"
            )
        self._column = labels.index(CODE)
        self._onset = self._answer = self._now = math.nan
        self._decided = False
        self._hits: deque[tuple[float, float]] = deque()

    def update(self, times: FloatArray, samples: FloatArray) -> Estimated | None:
        for time, code in zip(times, samples[:, self._column], strict=True):
            self._take(float(time), float(code))
        now = self._now
        while self._hits and self._hits[0][0] <= now - self._settings.window_s:
            self._hits.popleft()
        if not self._decided:
            return None
        if not self._hits:
            return Estimated(now, now, (math.nan,))
        mean = math.fsum(answer for _, answer in self._hits) / len(self._hits)
        return Estimated(now, self._hits[0][0], (mean,))

    def _take(self, time: float, code: float) -> None:
        if code in {STIMULUS, RESPONSE, OUTCOME}:
            self._now = time  # other events may be learnt later than they happened
        if code == STIMULUS:
            self._onset, self._answer = time, math.nan
        elif code == RESPONSE and math.isnan(self._answer):
            self._answer = time - self._onset
        elif code == OUTCOME:
            least, most = self._settings.hit_s
            if 0.0 < time - self._onset - most <= SOON_S:
                self._decided = True
                if least <= self._answer <= most:
                    self._hits.append((self._onset, self._answer))
            self._onset = math.nan
