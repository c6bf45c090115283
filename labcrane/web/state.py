"""State of a session as both pages show it, from its events."""

import json
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from labcrane.core.records import Event, Value, is_done
from labcrane.session.standing import STOP, SessionStage, Standing
from labcrane.web.assessment import Assessment
from labcrane.web.control_room.sentences import INSTRUCTIONS, met, sentence

KEPT = 500
"""Newest events that a page can show."""

RATES = 60
"""How many of the newest rates of each stream are kept."""


STARTING, BETWEEN = "starting", "between steps"
SAID = {
    "consent.needed": "waiting for the participant's consent",
    "consent.given": STARTING,
    "waiting": "ready to start: {what}",
    "trial.start": "trial",
    "judgement.awaited": "the test has ended: mark it completed or not, or override its end, "
    "then continue; otherwise its outcome stays as it is",
    "break.start": "break of {seconds} s",
    "fixation.shown": "eye tracker check: point {point}",
    "questionnaire.start": "questionnaire: {title}",
    "session.end": "ended: {reason}",
    **dict.fromkeys(
        ("step.end", "questionnaire.end", "break.end", "fixation.over", "judgement.over"), BETWEEN
    ),
}
"""The page's text for the session's state after an event."""

EARLIER_RULE = "a stop rule was met earlier: continue or end the session"
"""The page's text for a stop rule that had paused a session before it was resumed."""

LOST = {
    "input": "the controls", "disk": "the disk", "stream": "stream", "feedback": "",
    "trigger": "trigger",
}  # fmt: skip
"""What can be lost, and what it is called."""


@dataclass(frozen=True, slots=True)
class SessionLeft:
    """What a session left behind, as its page shows it.

    Attributes
    ----------
    level, verdict, remedy
        How it ended: ``"ok"``, ``"warn"`` or ``"bad"``, in words, and what to do about it.
    saved
        What was saved and where, a line each.
    columns, rows, advice
        The sync report.
    """

    level: str
    verdict: str
    remedy: str = ""
    saved: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    advice: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class OpenFault:
    """Something that is lost now.

    Attributes
    ----------
    kind, name
        What it is, as in :data:`LOST`, and which of them.
    why
        What failed and why, in words.
    since
        When it was lost first, on the session's clock.
    attempt, attempts
        Which of how many starts is under way; 0 where none is.
    accepted
        Whether the experimenter goes on without it.
    """

    kind: str
    name: str
    why: str
    since: float
    attempt: int = 0
    attempts: int = 0
    accepted: bool = False


ROUTINE = (
    "trial.", "order.", "questionnaire.", "step.", "block.", "pause.", "session.", "signal.",
    "scene.", "consent.", "stop_rule.", "estimate.",
)  # fmt: skip
"""Prefixes of the events that are not counted in a trial."""


class SessionView:
    """Follows the events. A thread writes, pages look at ``version`` and read.

    Attributes
    ----------
    version
        Grows with every event.
    events
        The newest events, oldest first.
    standing, text
        Where the session stands, and the same in words.
    trials_done, counts
        How many trials are done, and what happened in the running one.
    things
        What stands around the machine in the running trial, as of
        :func:`labcrane.machines.scene_codec.read_placed`; empty for nothing.
    form, order, answers, refusal
        The questionnaire that is asked, the names of its questions in their order where that was
        drawn, its recorded answers, and the last refusal.
    form_version
        Grows with every questionnaire.
    streams
        The recorder's status of the external streams.
    instructions
        The text that the operator reads; empty for none.
    consent
        What is asked before the session: file, version and text; nothing when none is.
    reported
        What was reported as seen in the running trial, in the order in which it came.
    rates
        The newest rates of each stream, in Hz, oldest first; None where none is known.
    faults
        What is lost now, by kind and name.
    settings
        Settings that were changed, by name of the cue or sound.
    rows
        What was measured in each trial that is counted and over, oldest first.
    ended
        What the session left behind; None before its end.
    assessment
        The performance indicator as it stands.
    """

    def __init__(self) -> None:
        self.version = 0
        self.events: deque[Event] = deque(maxlen=KEPT)
        self.standing = Standing()
        self.text = STARTING
        self.trial_began = 0.0
        self.trials_done = 0
        self.things = ""
        self.counts: Counter[str] = Counter()
        self.form: str | None = None
        self.order = self.turned = ""
        self.form_version = 0
        self.answers: dict[str, Value] = {}
        self.refusal = ""
        self.refused_item = ""
        self.streams: Mapping[str, Any] = {}
        self.reported: list[str] = []
        self.rates: dict[str, deque[float | None]] = {}
        self.faults: dict[tuple[str, str], OpenFault] = {}
        self.settings: dict[str, dict[str, Value]] = {}
        self.rows: list[Mapping[str, Value]] = []
        self.ended: SessionLeft | None = None
        self.alarm = ""
        self.instructions = ""
        self.consent: Mapping[str, Value] = {}
        self.assessment = Assessment()

    @property
    def over(self) -> bool:
        """Whether the session has ended."""
        return self.standing.stage is SessionStage.ENDED or self.ended is not None

    @property
    def trial(self) -> Mapping[str, Value]:
        """What is known of the running trial; empty for none."""
        return self.standing.trial

    def take(self, event: Event) -> None:
        """Take in the next event."""
        self.events.append(event)
        self.assessment.take(event)
        self.standing = self.standing.after(event.name, event.data)
        self._say(event)
        kind, _, what = event.name.partition(".")
        match kind:
            case "questionnaire":
                self._form(what, event.data)
            case "trial":
                self._trial(what, event.time, event.data)
            case "scene":
                self.things = str(event.data["things"])
            case "consent":
                self.consent = event.data if what == "needed" else {}
            case "pause" if event.data["by"] == STOP:
                self.alarm = (self.alarm or EARLIER_RULE) if what == "start" else ""
            case "stop_rule" if what == "met":
                self.alarm = f"{met(event.data)}: continue or end the session"
        self._count(event)
        if kind in LOST:
            self._fault(kind, what, event)
        elif event.name in {"order.again", "order.without"} and event.data["refused"] is None:
            now = self.faults["feedback", str(event.data["text"])]
            again = event.name == "order.again"
            now = replace(now, attempt=int(again), accepted=now.accepted or not again)
            self.faults[now.kind, now.name] = now
        self.version += 1

    def _say(self, event: Event) -> None:
        """State in words where the session is, and what the operator reads."""
        if event.name == "waiting" and event.data["what"] == INSTRUCTIONS:
            self.text = sentence(event, str).text
        elif event.name in SAID:
            self.text = SAID[event.name].format(**event.data)
        if event.name in {"instructions.shown", "step.end"}:
            self.instructions = str(event.data.get("text", ""))

    def _count(self, event: Event) -> None:
        """Count what happens in a trial, and note what was reported as seen."""
        if event.name == "session.standing":
            self.trials_done = int(str(event.data["done"]))
        elif event.name == "order.report" and event.data["refused"] is None:
            self.reported.append(str(event.data["text"]))
        elif self.trial and not event.name.startswith(ROUTINE):
            self.counts[event.name] += 1

    def hear_of_streams(self, status: Mapping[str, Any]) -> None:
        """Store the recorder's present status of the external streams."""
        self.streams = status
        for stream in status.get("streams", ()):
            kept = self.rates.setdefault(stream["label"], deque(maxlen=RATES))
            kept.append(stream.get("rate_hz"))

    def _fault(self, kind: str, what: str, event: Event) -> None:
        """Note what was lost, is back, or has another value."""
        data = event.data
        name = str(data.get("what", ""))
        key = (kind, name or str(data.get("trigger", "")))
        if (kind, what) == ("feedback", "setting"):
            mine = self.settings.setdefault(str(data["feedback"]), {})
            mine[str(data["key"])] = data["value"]
        elif what == "lost":
            why = f": {data['why']}" if data.get("why") else ""
            said = f"{LOST[kind]} {name}".strip() + " failed" + why
            before = self.faults.get(key, OpenFault(*key, said, event.time))
            attempt, attempts = (int(str(data.get(n, 0))) for n in ("attempt", "attempts"))
            self.faults[key] = replace(before, why=said, attempt=attempt, attempts=attempts)
        elif what in {"back", "ready"}:
            self.faults.pop(key, None)

    def _trial(self, what: str, time: float, data: Mapping[str, Value]) -> None:
        if what == "start":
            self.trial_began = time
            self.counts.clear()
            self.reported.clear()
        elif what == "end":
            self.things = ""
            self.trials_done += is_done(data)
            if is_done(data):
                self.rows.append(data)

    def _form(self, what: str, data: Mapping[str, Value]) -> None:
        match what:
            case "start":
                self.form = str(data["questionnaire"])
                self.order, self.turned = str(data.get("order", "")), str(data.get("turned", ""))
                self.answers = json.loads(str(data["kept"]))
                self.refusal = ""
                self.form_version += 1
            case "answer":
                self.answers[str(data["item"])] = data["value"]
                self.refusal = ""
            case "refused":
                self.refusal, self.refused_item = str(data["why"]), str(data["item"])
            case "end":
                self.form = None
                self.form_version += 1
