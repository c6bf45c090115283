"""One attempt at a trial, from its start to its row in the trial table."""

from collections.abc import Mapping

from labcrane.core.records import Event, Frame, Phase, Trial, TrialStatus, Value
from labcrane.core.roles import Task
from labcrane.design.plan import PlannedBlock
from labcrane.design.tracks import SUCCESS


class TrialRun:
    """Runs next to the loop while a trial is under way.

    Attributes
    ----------
    phase
        Where the trial stands.
    about
        Data that every event of the trial contains.
    row
        Its row of the trial table, when it has ended; empty before.
    """

    def __init__(self, task: Task, block: PlannedBlock, trial: Trial, rate_hz: float) -> None:
        self.phase = Phase.RUNNING
        self.about: dict[str, Value] = {
            "trial": trial.number,
            "attempt": trial.attempt,
            "block": block.number,
            "block_name": block.name,
            "practice": block.practice,
            "counted": trial.planned.counted,
            **({"group": block.group} if block.group else {}),
            **({"reference": True} if block.reference else {}),
            **trial.planned.condition,
        }
        if block.feedback:
            self.about["feedback"] = "+".join(block.feedback[trial.number]) or "none"
        self.row: dict[str, Value] = {}
        self.completion: bool | None = None
        self._trial = trial
        self._task = task
        self._track = block.track.settings if block.track and trial.planned.counted else None
        self._tracked = block.track is not None
        self._rate_hz = rate_hz
        self._period = 1.0 / rate_hz
        self._ticks = 0
        self._paused_ticks = 0
        self._late_ticks = 0
        self._worst_s = 0.0
        self._began: float | None = None

    @property
    def begun(self) -> bool:
        """Whether it has had a tick."""
        return self._began is not None

    @property
    def ticks(self) -> int:
        """Ticks so far, pauses left out."""
        return self._ticks

    @property
    def task(self) -> Task:
        """What judges it."""
        return self._task

    def skip(self, ticks: int) -> None:
        """Take as many ticks on time that its task has judged, and in which nothing happened."""
        self._ticks += ticks

    def lift_limits(self) -> None:
        """Let the trial go on past its automatic ends."""
        self._task.lift_limits()

    def doubt(self, what: str) -> str | None:
        """Return why the task does not ask whether ``what`` was seen, or None when it does."""
        if what in self._task.reports:
            return None
        return f"this task asks for reports of {', '.join(self._task.reports) or 'nothing'}"

    def evaluate(self, frame: Frame, wish: Phase | None) -> None:
        """Complete ``frame``; ``wish`` ends the trial whatever the task thinks."""
        if self._began is None:
            self._began = frame.tick.due
        self._worst_s = max(self._worst_s, frame.tick.late_s)
        self._late_ticks += frame.tick.late_s > self._period
        frame.trial = self._trial.number
        frame.elapsed = self._ticks / self._rate_hz
        judgement = None
        if frame.paused:
            self._paused_ticks += 1
        else:
            self._ticks += 1
            judgement = self._task.evaluate(frame)
            frame.task = judgement.values
            if judgement.events:
                frame.events += tuple(self._of_this_trial(event) for event in judgement.events)
            self.phase = judgement.phase
        if wish is not None and not self.phase.over:
            self.phase = wish
        frame.phase = self.phase
        if self.phase.over:
            self.row = self._row(frame, judgement)
            frame.events += (Event("trial.end", frame.tick.due, self.row),)

    def _of_this_trial(self, event: Event) -> Event:
        return Event(event.name, event.time, {"trial": self._trial.number, **event.data})

    def _row(self, frame: Frame, judgement: TrialStatus | None) -> dict[str, Value]:
        results: dict[str, Value] = {
            column: None for signal in self._task.results for column in signal.columns
        }
        if judgement is not None:
            results.update(judgement.results)
        return {
            **self.about,
            "outcome": str(self.phase),
            **results,
            **self._told(results),
            "completion": None if self.completion is None else int(self.completion),
            "started": self._began,
            "ended": frame.tick.due,
            "seed": self._trial.seed,
            "paused": self._paused_ticks / self._rate_hz,
            "late_ticks": self._late_ticks,
            "worst_lateness": self._worst_s,
        }

    def _told(self, results: Mapping[str, Value]) -> dict[str, Value]:
        """Return what the trial tells its track; nothing without one."""
        if not self._tracked:
            return {}
        success = None if self._track is None else self._track.judge(self.phase, results)
        return {SUCCESS: None if success is None else int(success)}
