"""Snapshot of a session: everything the control room shows, ready for JSON."""

import json
import math
import time
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from labcrane.analysis.presented import operators_views
from labcrane.core.records import Event
from labcrane.core.signals import Signal
from labcrane.design.counts import TrialCounts
from labcrane.protocol.questions import about, questions
from labcrane.protocol.study import Study
from labcrane.recording.pictures import LOG
from labcrane.web.control_room.bars import groups
from labcrane.web.control_room.buttons import about_failed, answers, buttons
from labcrane.web.control_room.condition import (
    STATES,
    ExpectedSession,
    handled,
    lamp_of,
    shown_badly,
    state_of,
)
from labcrane.web.control_room.earlier import Earlier
from labcrane.web.control_room.sentences import FILTERS, held, sentence
from labcrane.web.control_room.sliders import sliders
from labcrane.web.page import PageContext

NEWEST = 120
"""Events that are listed."""


class Snapshot:
    """Builds the content of the page."""

    def __init__(self, context: PageContext, earlier: Earlier) -> None:
        self._context = context
        self._earlier = earlier
        self._counts = TrialCounts.of(context.plan)
        self._signals = _measures(context)
        self._told: list[tuple[Event, dict[str, Any]]] = []
        self._number = 0
        self._began: float | None = None
        study = context.study
        views = {
            f"views.{name}": choice.described(study.path.parent)
            for name, choice in study.views.items()
        }
        self._period_s = 1.0 / study.protocol.rate_hz
        self._expected = ExpectedSession(
            self._period_s,
            operators_views(views),
            study.protocol.presented,
            list(study.protocol.streams),
        )

    def parts(self) -> dict[str, Any]:
        """Return everything that is shown, by name."""
        return {**self._head(), **self._body()}

    def _head(self) -> dict[str, Any]:
        context = self._context
        session, plan = context.session, context.plan
        state, steps = state_of(session), self._steps()
        holds = "".join(f" · {held(by)}" for by in sorted(session.standing.holds))
        trouble = context.shown.trouble or context.live.trouble
        lamp = lamp_of(session, context.live, self._expected, trouble)
        return {
            "who": f"{context.participant} · session {plan.number}",
            "condition": " · ".join(filter(None, [
                context.study.protocol.title or context.study.protocol.study, plan.name,
                plan.group and f"group {plan.group}", self._practice(),
            ])),
            "state": state,
            "now": self._running() if state == "running" else STATES[state],
            "instructions": session.instructions,
            "stage": session.text + holds,
            "steps": steps,
            "next": next((s["name"] for s in steps if not s["state"]), "the end of the session"),
            "facts": " · ".join(self._facts()),
            "left": self._left(state),
            "done": session.trials_done,
            "total": len(plan.trials),
            "lamp": asdict(lamp),
            "alarm": session.alarm,
            "faults": self._faults(),
            "asked": session.form is not None,
            "buttons": [button.as_json() for button in buttons(session)],
            "report": asdict(session.ended) if session.ended else None,
        }  # fmt: skip

    def _body(self) -> dict[str, Any]:
        context = self._context
        live, session = context.live, context.session
        lines = session.assessment.lines(live.newest, context.study.protocol.indicator)
        return {
            "questions": asked(context.study),
            "bars": groups(live.newest, live.units, context.study.machine.joints, live.moved),
            "performance": "\n".join(lines),
            "measures": [
                {"name": name, "unit": _unit(signal), "label": _label(name, signal)}
                for name, signal in self._signals.items()
            ],
            "results": self._results(),
            "late": [[round(1000 * part, 2) for part in band] for band in live.bands],
            "lateText": self._lateness(),
            "tickMs": 1000 * self._period_s,
            "streams": self._streams(),
            "noStreams": self._without_streams(),
            "settings": self._settings(),
            "kinds": list(FILTERS),
            "events": self._events(),
            "cameras": any(context.pictures.cameras.values()),
        }

    def _faults(self) -> list[dict[str, Any]]:
        session, found = self._context.session, []
        for fault in () if session.over else session.faults.values():
            does, todo = handled(fault, session.standing)
            solve = about_failed(fault.name, session) if fault.kind == "feedback" else []
            lasts = clock(time.perf_counter() - fault.since)
            found.append({
                "ident": "-".join(("fault", fault.kind, fault.name)), "what": fault.why,
                "lasts": lasts, "does": does, "todo": todo,
                "buttons": [button.as_json() for button in solve],
            })  # fmt: skip
        return found

    def _steps(self) -> list[dict[str, str]]:
        """Return the session's steps: their names, what is done, and how long each takes."""
        standing, found = self._context.session.standing, []
        for step in self._context.plan.steps:
            runs = "now" if step.number == standing.step else ""
            state = "done" if step.number <= standing.done else runs
            found.append({"name": step.title, "state": state, "time": _long(step.expected_s)})
        return found

    def _running(self) -> str:
        trial = self._context.session.trial
        again = f", attempt {trial['attempt']}" if trial["attempt"] != 1 else ""
        called = self._counts.name(int(str(trial["trial"])))
        return f"{called[:1].upper()}{called[1:]}{again}"

    def _practice(self) -> str:
        trial = self._context.session.trial
        feedback = trial.get("feedback")
        return " · ".join(filter(None, [
            str(trial.get("block_name", "")), "practice" if trial.get("practice") else "",
            f"feedback {feedback}" if feedback else "",
        ]))  # fmt: skip

    def _facts(self) -> list[str]:
        session, live = self._context.session, self._context.live
        found = [f"{name} {count}" for name, count in sorted(session.counts.items())]
        if live.lateness_s is not None:
            found.append(f"loop at most {1000 * live.lateness_s:.1f} ms late")
        return found

    def _left(self, state: str) -> str:
        trials = self._context.plan.trials
        left = sum(
            trial.planned.expected_s for trial in trials[self._context.session.trials_done :]
        )
        if state == "ended" or not trials:
            return "over" if state == "ended" else "-"
        return f"{_long(left)} left"

    def _results(self) -> dict[str, Any]:
        rows = self._context.session.rows
        return {
            name: {
                "mine": [_value(row[name]) for row in rows if _value(row.get(name)) is not None],
                "before": self._earlier.mine.get(name, []),
                "cohort": self._earlier.cohort(name),
            }
            for name in self._signals
        }

    def _lateness(self) -> str:
        bands = self._context.live.bands
        if not bands:
            return ""
        middle, worst = bands[-1][0], max(most for _, most in bands)
        return (
            f"loop: median {1000 * middle:.2f} ms now, at most {1000 * worst:.1f} ms in the last "
            f"minute; a tick has {1000 * self._period_s:.1f} ms (dashed)"
        )

    def _streams(self) -> list[dict[str, Any]]:
        """Return the streams, also of views and sounds; a view that shows too little says so."""
        session = self._context.session
        wrong, found = shown_badly(session, self._expected), []
        for stream in session.streams.get("streams", ()):
            one = _stream(stream, list(session.rates.get(stream["label"], ())))
            if why := wrong.get(stream["label"]):
                one |= {"level": "bad", "words": f"{one['words']}: {why}"}
            found.append(one)
        return found

    def _without_streams(self) -> str:
        """Return the text that is shown while no external stream has come."""
        streams = self._context.session.streams.get("streams", ())
        if any(not str(each.get("name", "")).startswith(LOG) for each in streams):
            return ""
        asked = ", ".join(self._expected.streams)
        if asked:
            return f"Waiting for the study's streams: {asked}."
        return "This study records no external streams."

    def _settings(self) -> list[dict[str, Any]]:
        study, changed = self._context.study, self._context.session.settings
        found = []
        for name, part in {**study.cues, **study.sounds}.items():
            controls = sliders(name, part.settings, changed.get(name, {}))
            if controls:
                found.append({"name": name, "use": part.name, "controls": controls})
        return found

    def _events(self) -> list[dict[str, Any]]:
        kept = list(self._context.session.events)[-NEWEST:]
        known = {id(event): told for event, told in self._told}
        self._told = [(event, known.get(id(event)) or self._tell(event)) for event in kept]
        return [told for _, told in reversed(self._told)]

    def _tell(self, event: Event) -> dict[str, Any]:
        self._number += 1
        if self._began is None:
            self._began = event.time
        said = sentence(event, self._counts.name)
        data = {key: value for key, value in event.data.items() if value not in {None, ""}}
        return {
            "n": self._number, "time": clock(event.time - self._began), "text": said.text,
            "kind": said.kind, "level": said.level,
            "raw": f"{event.time:.3f}  {event.name}  {json.dumps(data, ensure_ascii=False)[:2000]}",
        }  # fmt: skip


def _long(seconds: float) -> str:
    """Return how long something takes, as people say it."""
    return f"{seconds / 60:.0f} min" if seconds >= 60 else f"{seconds:.0f} s"  # noqa: PLR2004


def clock(seconds: float) -> str:
    """Return a time as minutes and seconds, with hours where there are some."""
    whole = max(0, int(seconds))
    minutes = f"{whole // 60 % 60}:{whole % 60:02}"
    return minutes if whole < 3600 else f"{whole // 3600}:{minutes.zfill(5)}"  # noqa: PLR2004


def _measures(context: PageContext) -> dict[str, Signal]:
    """Return what the study's tasks measure, by the column of the trial table."""
    return {
        column: signal
        for task in context.study.tasks.values()
        for signal in task.results
        for column in signal.columns
    }


def _unit(signal: Signal) -> str:
    return "" if signal.unit == "1" else signal.unit


def _label(name: str, signal: Signal) -> str:
    unit = _unit(signal)
    return name.replace("_", " ") + (f", {unit}" if unit else "")


def _value(value: object) -> float | None:
    number = float(value) if isinstance(value, int | float) else math.nan
    return round(number, 6) if math.isfinite(number) else None


def _stream(stream: Mapping[str, Any], trace: list[float | None]) -> dict[str, Any]:
    faults = [f"{each['channel'] or 'all'}: {each['kind']}: {each['message']}"
              for each in stream["signals"]]  # fmt: skip
    absent = stream["condition"] in {"absent", "silent"}
    level = "bad" if absent and stream.get("required") else ""
    level = level or ("warn" if absent or stream["warnings"] or faults else "")
    rate, nominal = stream.get("rate_hz"), stream.get("nominal_hz")
    words = [str(stream["condition"])]
    if rate is not None:
        words.append(f"{rate:.0f} Hz" + (f" of {nominal:g}" if nominal else ""))
    if stream.get("rtt_s") is not None:
        words.append(f"clock round trip {1000 * stream['rtt_s']:.1f} ms")
    return {
        "label": stream["label"], "level": level, "words": ", ".join(words),
        "trace": trace, "lines": [*stream["warnings"], *faults],
        "answers": [button.as_json() for button in answers(stream)],
    }  # fmt: skip


def asked(study: Study) -> list[dict[str, str]]:
    """Return the warnings of ``labcrane check`` for a study, by the idents of the page's lines."""
    found = []
    for question in questions(study):
        said = about(study, question)
        text = f"line {said['line']} of {study.path.name}: {said['message']}"
        found.append({"ident": f"question-{question.key}", "text": text})
    return found
