"""The session's whole context as a string stream: LSL keeps no history, so it is sent again.

A sample of ``labcrane.context`` is a JSON object of two parts: ``scene``, which never changes
(:func:`labcrane.recording.run_codec.read_run`), and ``situation``
(:class:`labcrane.core.records.SessionState`). It is sent at every change and once a second:
a reader that starts late, or restarts, needs one sample only.
"""

import json
import time
from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import cache
from typing import TYPE_CHECKING, Any

from pydantic import TypeAdapter

from labcrane.core.records import Event, Frame, Run, SessionState, is_done
from labcrane.recording.run_codec import write_run
from labcrane.streams.outlets import channel, stream_info

if TYPE_CHECKING:
    import pylsl

CONTEXT = "labcrane.context"

EVERY_S = 1.0

NO_TRIALS: Mapping[int, int] = {}
"""Which of the counted trials each is, where none is counted: a recording that is shown again."""


def situation_after(
    situation: SessionState, event: Event, counted: Mapping[int, int] = NO_TRIALS
) -> SessionState:
    """Return what the session is about once ``event`` has happened.

    ``counted`` says which of the counted trials each is, by its number in the plan.
    """
    data: Mapping[str, Any] = event.data
    counts = {**situation.counts, event.name: situation.counts.get(event.name, 0) + 1}
    now = replace(situation, counts=counts)
    match event.name:
        case "session.start":  # of a part: another process, which knows of nothing before
            return SessionState(trials=situation.trials, done=situation.done)
        case "step.start":
            return replace(now, step=data["step"], kind=data["kind"])
        case "block.start":
            return replace(
                now,
                block=data["block"],
                block_name=data["block_name"],
                practice=data["practice"],
                waiting="",
            )
        case "trial.start":
            named = data.get("feedback", "none")
            active = () if named == "none" else tuple(named.split("+"))
            which = counted.get(data["trial"], 0)
            return replace(now, trial=data["trial"], active=active, counted=which)
        case "trial.end":
            return replace(now, trial=0, active=(), counted=0, done=now.done + is_done(data))
        case "scene.placed":
            return replace(now, scene=data["things"])
        case "feedback.setting":
            mine = {**situation.settings.get(data["feedback"], {}), data["key"]: data["value"]}
            return replace(now, settings={**situation.settings, data["feedback"]: mine})
    return _standing_after(_read_after(now, event), event)


def _standing_after(now: SessionState, event: Event) -> SessionState:
    """Return the situation with why nobody is to move once ``event`` has happened."""
    data: Mapping[str, Any] = event.data
    match event.name:
        case "pause.start":
            return replace(now, held=tuple(dict.fromkeys((*now.held, data["by"]))))
        case "pause.end":
            return replace(now, held=tuple(who for who in now.held if who != data["by"]))
        case "waiting":
            return replace(now, waiting=data["what"])
        case "break.start":
            return replace(now, waiting="break")
        case "judgement.awaited":
            return replace(now, waiting="judgement")
        case "step.end" | "break.end" | "judgement.over":
            return replace(now, waiting="")
        case "session.end":
            return replace(now, waiting="", over=data["reason"])
    return now


def _read_after(now: SessionState, event: Event) -> SessionState:
    """Return the situation with what the operator is to read once ``event`` has happened."""
    data: Mapping[str, Any] = event.data
    match event.name:
        case "instructions.shown":
            return replace(now, text=data["text"])
        case "questionnaire.start":
            return replace(now, questionnaire=data["title"])
        case "step.end" | "questionnaire.end":
            return replace(now, text="", questionnaire="")
        case "fixation.shown":
            return replace(now, waiting="", fixation=(data["x"], data["y"]))
        case "fixation.over":
            return replace(now, fixation=())
        case "order.hint" if data["refused"] is None:
            return replace(now, hint=data["text"], hint_time=event.time)
    return now


class ContextOutlet:
    """Sends the context at every event and once a second.

    Parameters
    ----------
    counted
        Which of the counted trials each is, from 1, by its number in the plan.
    done
        How many of them were over before: of a session that goes on.
    """

    def __init__(
        self, run: Run, source: str, counted: Mapping[int, int] = NO_TRIALS, done: int = 0
    ) -> None:
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

        info = stream_info(CONTEXT, "Context", 1, "string", rate_hz=0.0, source=source)
        channel(info, label="context", unit="none", type="JSON")
        self._outlet: pylsl.StreamOutlet | None = pylsl.StreamOutlet(info)
        self._scene = write_run(run)
        self._counted = counted
        self._situation = SessionState(trials=len(counted), done=done)
        self._due = float("-inf")

    @property
    def description(self) -> str:
        """The stream as XML: a reader that has it needs no search."""
        return "" if self._outlet is None else str(self._outlet.get_info().as_xml())

    def push(self, frame: Frame) -> None:
        """Take up what happened in a frame, and send the context if it changed or is due."""
        for event in frame.events:
            self._situation = situation_after(self._situation, event, self._counted)
        if self._outlet is None or not (frame.events or frame.tick.due >= self._due):
            return
        self._due = frame.tick.due + EVERY_S
        situation = json.dumps(asdict(self._situation))
        text = f'{{"scene": {self._scene}, "situation": {situation}}}'
        self._outlet.push_sample([text], frame.tick.due)

    def close(self) -> None:
        """End the stream."""
        self._outlet = None


class ContextInlet:
    """Receives the context and knows what it said last.

    Attributes
    ----------
    text
        The newest sample as it came; empty before the first.
    situation
        The session's present state.
    """

    def __init__(self, info: "pylsl.StreamInfo") -> None:
        import pylsl  # noqa: PLC0415

        self._inlet = pylsl.StreamInlet(info, max_buflen=60, recover=False, processing_flags=0)
        self._lost = pylsl.util.LostError
        self.text = ""
        self.situation = SessionState()

    def changed(self, wait_s: float = 0.0) -> bool:
        """Take what has come; whether the situation is another one now."""
        newest = None
        try:
            sample, _ = self._inlet.pull_sample(timeout=wait_s)
            while sample is not None:
                newest = sample[0]
                sample, _ = self._inlet.pull_sample(timeout=0.0)
        except self._lost:  # the session has ended, and this process is about to
            time.sleep(wait_s)
        if newest is None:
            return False
        self.text = newest
        before, self.situation = self.situation, situation_of(json.loads(newest)["situation"])
        return self.situation != before


@cache
def _codec() -> TypeAdapter[SessionState]:
    return TypeAdapter(SessionState)


def situation_of(found: Mapping[str, Any]) -> SessionState:
    """Return the situation that JSON holds."""
    return _codec().validate_python(found)
