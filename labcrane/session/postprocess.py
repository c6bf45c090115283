"""Postprocessing of a session that has ended: corrected clocks, and the sync report."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from labcrane.protocol.streams import StreamNeed, TimeLimits
from labcrane.recording.foreign_streams import Conclusion, Correction, RecordedStream
from labcrane.recording.journal_reader import SessionLog
from labcrane.streams.sync.correction import Treatment, correct
from labcrane.streams.sync.raw import raw_of
from labcrane.streams.sync.resync import correction_of, treatment_of
from labcrane.streams.sync.stream_report import StreamReport, judge_stream
from labcrane.streams.sync.sync_report import LoopReport, SyncReport, judge_loop, never_came


class SessionConclusion:
    """Corrects and judges the streams of one session, by what its protocol says of them.

    Attributes
    ----------
    sync_report
        The report, once it has been made.
    """

    def __init__(self, context: Mapping[str, Any]) -> None:
        self._needs = {
            label: StreamNeed.model_validate(need)
            for label, need in context.get("streams", {}).items()
        }
        self._limits = TimeLimits.model_validate(context.get("sync", {})).limits()
        self._rate_hz = context.get("rate_hz")
        self._manual = context.get("clock") == "manual"
        self._judged: list[StreamReport] = []
        self._came: set[str] = set()
        self.sync_report: SyncReport | None = None

    def correct(self, recorded: RecordedStream) -> Correction:
        """Return a stream's times on our clock."""
        label, treatment = self._treatment(recorded)
        if label is not None:
            self._came.add(label)
        corrected = correct(raw_of(recorded), treatment)
        required = label is None or self._needs[label].required
        self._judged.append(
            judge_stream(recorded, corrected.quality, self._limits, required=required)
        )
        return correction_of(corrected, treatment)

    def report(self, log: SessionLog) -> Mapping[str, Any]:
        """Return the sync report of the session, ready for JSON."""
        missing = {
            label: need.required for label, need in self._needs.items() if label not in self._came
        }
        loop = None if self._manual else self._loop(log)
        self.sync_report = SyncReport(tuple(self._judged), loop, never_came(missing))
        return self.sync_report.as_json()

    def _treatment(self, recorded: RecordedStream) -> tuple[str | None, Treatment]:
        header = recorded.header
        for label, need in self._needs.items():
            if need.is_for(header):
                return label, need.treatment(header)
        return None, treatment_of(header)

    def _loop(self, log: SessionLog) -> LoopReport | None:
        columns = [log.column("loop", name) for name in ("due", "woke", "tick")]
        if self._rate_hz is None or any(column is None for column in columns):
            return None
        due, woke, tick = (np.asarray(column) for column in columns)
        same_part = np.diff(log.part) == 0
        dropped = int(np.sum((np.diff(tick) - 1.0)[same_part]))
        return judge_loop(due, woke, float(self._rate_hz), self._limits, dropped)


def conclude(context: Mapping[str, Any]) -> Conclusion:
    """Return what consolidation needs to conclude a session with this context."""
    conclusion = SessionConclusion(context)
    return Conclusion(conclusion.correct, conclusion.report)
