"""Buttons of the control room: what makes sense now, and which of them comes first."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from labcrane.session.commands import Order
from labcrane.web.room.condition import EXAMINER, state_of
from labcrane.web.state import SessionView


@dataclass(frozen=True, slots=True)
class Button:
    """A button: what it orders, what it is called now, and its key.

    Attributes
    ----------
    why
        Why it makes no sense now; empty where it does.
    asks
        What is asked before it is obeyed; empty for nothing.
    """

    ident: str
    order: str
    text: str
    label: str
    key: str
    why: str = ""
    asks: str = ""
    primary: bool = False
    danger: bool = False

    def as_json(self) -> dict[str, Any]:
        """Return what JSON can hold."""
        return asdict(self)


STARTS: Mapping[str, str] = {
    "waiting": "Start",
    "paused": "Go on",
    "decision": "Go on all the same",
    "fault": "Go on",
    "judgement": "Go on",
}
NOT_YET = "the session waits for its streams and feedback, and begins by itself"
PAUSABLE = {"waiting", "running", "break", "fixation", "questionnaire", "between", "fault",
            "judgement"}  # fmt: skip
SKIPPABLE = {"break", "fixation", "questionnaire"}
NO_TRIAL = "no trial is running"


def answers(stream: Mapping[str, Any]) -> list[Button]:
    """Return the buttons that say which stream of a type is meant, where that is asked."""
    label, words = stream["label"], [each["identity"] for each in stream["candidates"]]
    ids = [source_id for source_id, _, _ in words]
    found = []
    for at, (source_id, name, _) in enumerate(words):
        # Programs may share a source_id, and then have names.
        word = source_id if source_id and ids.count(source_id) == 1 else name
        host = stream["candidates"][at]["host"]
        found.append(
            Button(
                f"take-{label}-{at}", Order.TAKE, f"{label}={word}", f"Take {name} of {host}", "T"
            )
        )
    if found and not stream["required"]:
        found.append(Button(f"take-{label}-none", Order.TAKE, f"{label}=none", "Leave out", ""))
    return found


def buttons(view: SessionView) -> list[Button]:
    """Return all buttons as they are now; exactly one is primary unless nothing can be done."""
    state = state_of(view)
    over = "the session has ended" if state == "ended" else ""
    startable = (state in STARTS and state != "fault") or EXAMINER in view.holds
    idle = NOT_YET if state == "starting" else "nothing waits to start"
    waits = view.stage.what if state == "waiting" else ""
    start = f"{STARTS.get(state, 'Start')}{': ' + waits if waits else ''}"
    pause = "" if state in PAUSABLE and EXAMINER not in view.holds else "nothing to pause"
    judged = "" if view.trial or view.last_trial else NO_TRIAL
    running = "" if view.trial else NO_TRIAL
    skips = "" if view.trial or state in SKIPPABLE else "nothing to skip"
    return [
        Button(
            "order-start", Order.START, "", start, "Space",
            over or ("" if startable else idle), primary=startable,
        ),
        Button(
            "order-pause", Order.PAUSE, "", "Pause", "P", over or pause,
            primary=not startable and not pause and not over,
        ),
        Button("order-repeat", Order.REPEAT, "", "Repeat trial", "R", over or running),
        Button("order-skip", Order.SKIP, "", "Skip", "S", over or skips,
               asks="Skip what runs now? It is not asked for again.", danger=True),
        Button("order-override", Order.OVERRIDE, "", "Override end", "O", over or judged),
        Button("order-completion1", Order.COMPLETION, "1", "Completed", "C", over or judged),
        Button("order-completion0", Order.COMPLETION, "0", "Not completed", "X", over or judged),
        Button(
            "order-end", Order.END, "", "End session", "E", over,
            asks="End the session now? What is recorded is kept.", danger=True,
        ),
    ]  # fmt: skip
