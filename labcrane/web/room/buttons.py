"""Buttons of the control room: what makes sense now, and which of them comes first."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from labcrane.session.commands import Order
from labcrane.session.standing import ENDED, EXAMINER, STOP, SessionStage, Standing, why_not
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

    def why(order: Order) -> str:
        return ENDED if view.over else why_not(order, view.standing) or ""

    start, pause, judged = why(Order.START), why(Order.PAUSE), why(Order.COMPLETION)
    return [
        Button(
            "order-start", Order.START, "", _start(view.standing), "Space", start, primary=not start
        ),
        Button(
            "order-pause", Order.PAUSE, "", "Pause", "P", pause, primary=bool(start) and not pause
        ),
        Button("order-repeat", Order.REPEAT, "", "Repeat trial", "R", why(Order.REPEAT)),
        Button("order-skip", Order.SKIP, "", "Skip", "S", why(Order.SKIP),
               asks="Skip what runs now? It is not asked for again.", danger=True),
        Button("order-override", Order.OVERRIDE, "", "Override end", "O", why(Order.OVERRIDE)),
        Button("order-completion1", Order.COMPLETION, "1", "Completed", "C", judged),
        Button("order-completion0", Order.COMPLETION, "0", "Not completed", "X", judged),
        Button(
            "order-end", Order.END, "", "End session", "E", why(Order.END),
            asks="End the session now? What is recorded is kept.", danger=True,
        ),
    ]  # fmt: skip


def _start(standing: Standing) -> str:
    """Return what the order to start does now."""
    if STOP in standing.holds:
        return "Go on all the same"
    if EXAMINER in standing.holds or standing.stage is SessionStage.JUDGEMENT:
        return "Go on"
    return f"Start: {standing.what}" if standing.what else "Start"
