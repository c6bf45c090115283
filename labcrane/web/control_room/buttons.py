"""Buttons of the control room: which are possible now, and which one is primary."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from labcrane.session.commands import Order
from labcrane.session.standing import ENDED, EXAMINER, STOP, SessionStage, Standing, why_not
from labcrane.web.control_room.sentences import INSTRUCTIONS
from labcrane.web.state import SessionView


@dataclass(frozen=True, slots=True)
class Button:
    """A button: its action, its present label and its key.

    Attributes
    ----------
    why
        Why it is not possible now; empty if it is possible.
    asks
        Question to confirm before the action is sent; empty for none.
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
        """Return the button as a mapping for JSON."""
        return asdict(self)


def answers(stream: Mapping[str, Any]) -> list[Button]:
    """Return the buttons that select one of several streams of a type, if a choice is needed."""
    label, words = stream["label"], [each["identity"] for each in stream["candidates"]]
    ids = [source_id for source_id, _, _ in words]
    found = []
    for at, (source_id, name, _) in enumerate(words):
        # Programs may share a source_id; their names then distinguish them.
        word = source_id if source_id and ids.count(source_id) == 1 else name
        host = stream["candidates"][at]["host"]
        found.append(
            Button(
                f"take-{label}-{at}", Order.TAKE, f"{label}={word}", f"Use {name} on {host}", "T"
            )
        )
    if found and not stream["required"]:
        found.append(
            Button(f"take-{label}-none", Order.TAKE, f"{label}=none", "Record without it", "")
        )
    return found


def about_failed(name: str, view: SessionView) -> list[Button]:
    """Return the buttons that solve the failure of a view or sound."""
    found = [Button(f"again-{name}", Order.AGAIN, name, "Start it again", "V")]
    found = [] if view.standing.why_not_about(Order.AGAIN, name) else found
    if not view.faults["feedback", name].accepted:
        found.append(Button(f"without-{name}", Order.WITHOUT, name, "Go on without it", "G"))
    return found


def buttons(view: SessionView) -> list[Button]:
    """Return all buttons; exactly one is primary unless no action is possible."""

    def why(order: Order) -> str:
        return ENDED if view.over else why_not(order, view.standing) or ""

    def button(order: Order, label: str, key: str, text: str = "", **more: Any) -> Button:
        return Button(f"order-{order}{text}", order, text, label, key, why(order), **more)

    start, pause = why(Order.START), why(Order.PAUSE)
    skip = "Skip this trial, break or questionnaire? It is not repeated."
    end = "End the session now? The recorded data are kept."
    return [
        button(Order.START, _start(view.standing), "Space", primary=not start),
        button(Order.PAUSE, "Pause", "P", primary=bool(start) and not pause),
        button(Order.REPEAT, "Repeat trial", "R"),
        button(Order.SKIP, "Skip", "S", asks=skip, danger=True),
        button(Order.OVERRIDE, "Override end", "O"),
        button(Order.COMPLETION, "Completed", "C", "1"),
        button(Order.COMPLETION, "Not completed", "X", "0"),
        button(Order.END, "End session", "E", asks=end, danger=True),
    ]


def _start(standing: Standing) -> str:
    """Return the label of the start button: what it does now."""
    if STOP in standing.holds:
        return "Continue anyway"
    if EXAMINER in standing.holds or standing.stage is SessionStage.JUDGEMENT:
        return "Continue"
    if standing.what == INSTRUCTIONS:
        return "They have read it: go on"
    return f"Start: {standing.what}" if standing.what else "Start"
