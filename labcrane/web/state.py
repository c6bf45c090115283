"""State of a session as both pages show it, from its events."""

import json
from collections import Counter, deque
from collections.abc import Mapping
from typing import Any

from labcrane.core.records import Event, Value, is_done
from labcrane.web.assessment import Assessment

KEPT = 200
"""Newest events that a page can show."""

ROUTINE = ("trial.", "order.", "questionnaire.", "step.", "block.", "pause.", "session.", "signal.")
"""Beginnings of event names that are no counts of a trial."""


class SessionView:
    """Follows the events. A thread writes, pages look at ``version`` and read.

    Attributes
    ----------
    version
        Grows with every event.
    events
        The newest events, oldest first.
    stage, holds, trial, trials_done, counts
        Where the session stands, who holds it, the running trial, and what happened in it.
    things
        What stands around the machine in the running trial, as of
        :func:`labcrane.machines.scene_codec.read_placed`; empty for nothing.
    form, answers, refusal
        The questionnaire that is asked, its recorded answers, and the last refusal.
    form_version
        Grows with every questionnaire.
    streams
        What the recorder says of the streams of others.
    consent
        What is asked before the session: file, version and text; nothing when none is.
    sync_report
        Lines of the session's sync report, at its end.
    reported
        What was reported as seen in the running trial, in the order in which it came.
    assessment
        The performance indicator as it stands.
    """

    def __init__(self) -> None:
        self.version = 0
        self.events: deque[Event] = deque(maxlen=KEPT)
        self.stage = "starting"
        self.holds: set[str] = set()
        self.trial: Mapping[str, Value] = {}
        self.trials_done = 0
        self.things = ""
        self.counts: Counter[str] = Counter()
        self.form: str | None = None
        self.form_version = 0
        self.answers: dict[str, Value] = {}
        self.refusal = ""
        self.refused_item = ""
        self.streams: Mapping[str, Any] = {}
        self.sync_report: list[str] = []
        self.last_trial: Mapping[str, Value] = {}
        self.reported: list[str] = []
        self.alarm = ""
        self.consent: Mapping[str, Value] = {}
        self.assessment = Assessment()

    def take(self, event: Event) -> None:
        """Take in the next event."""
        self.events.append(event)
        self.assessment.take(event)
        kind, _, what = event.name.partition(".")
        match kind:
            case "questionnaire":
                self._form(what, event.data)
            case "trial":
                self._trial(what, event.data)
            case "scene":
                self.things = str(event.data["things"])
            case "consent":
                self.consent = event.data if what == "needed" else {}
            case "pause":
                who = str(event.data["by"])
                (self.holds.add if what == "start" else self.holds.discard)(who)
            case "stop_rule":
                data = event.data
                self.alarm = (
                    f"{data['questionnaire']} {data['score']} is {data['value']}, above "
                    f"{data['above']}: go on, or end the session"
                )
            case _ if self.trial and not event.name.startswith(ROUTINE):
                self.counts[event.name] += 1
        if event.name == "order.report" and event.data["refused"] is None:
            self.reported.append(str(event.data["text"]))
        if event.name == "session.standing":
            self.trials_done = int(str(event.data["done"]))
        self._stage(event)
        self.version += 1

    def _stage(self, event: Event) -> None:
        match event.name:
            case "consent.needed":
                self.stage = "waits for the participant's consent"
            case "consent.given":
                self.stage = "starting"
            case "waiting":
                self.stage = f"waits to start: {event.data['what']}"
            case "trial.start":
                self.stage = "trial"
            case "break.start":
                self.stage = f"break of {event.data['seconds']} s"
            case "questionnaire.start":
                self.stage = f"questionnaire: {event.data['title']}"
            case "session.end":
                self.stage = f"ended: {event.data['reason']}"
            case "step.end" | "questionnaire.end" | "break.end":
                self.stage = "between steps"
            case "pause.end":
                self.alarm = ""

    def _trial(self, what: str, data: Mapping[str, Value]) -> None:
        if what == "start":
            self.trial = data
            self.counts.clear()
            self.reported.clear()
        elif what == "end":
            self.trial, self.things = {}, ""
            self.last_trial = data
            self.trials_done += is_done(data)

    def _form(self, what: str, data: Mapping[str, Value]) -> None:
        match what:
            case "start":
                self.form = str(data["questionnaire"])
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
