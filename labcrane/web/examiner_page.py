"""The experimenter's page: a control room that shows the session and sends actions."""

from typing import Any

from nicegui import ui

from labcrane.session.commands import Order
from labcrane.web.control_room.element import STYLE, Room
from labcrane.web.control_room.snapshot import Snapshot
from labcrane.web.form import ConsentCard, Form
from labcrane.web.page import PRIMARY, PageContext, prepare
from labcrane.web.panels import Cameras, Reports
from labcrane.web.participant_page import STYLE as FORM_STYLE
from labcrane.web.scene import SceneView
from labcrane.web.server.access import SUPERVISOR

RATE_S = 0.25

KEYS: tuple[tuple[str, str], ...] = (
    ("N", "write a note"),
    ("H", "write a hint to the operator"),
    ("F", "change a setting of a cue or sound"),
    ("T", "choose a stream, where a choice is needed"),
    ("V", "start a view or sound again that has failed"),
    ("G", "go on without a view or sound that has failed"),
    ("Q", "fill in the questionnaire"),
    ("D", "dark or light"),
    ("W", "on the wall: the status large enough for 3 m, and back"),
    ("?", "show these keys"),
)
"""What each key of the page does that is not a button's."""


def supervisor_page(context: PageContext) -> None:
    """Build the page."""
    ui.page_title(f"{context.participant} · labcrane")
    ui.colors(primary=PRIMARY)
    ui.add_css(STYLE)
    ui.add_css(FORM_STYLE)
    prepare("en", "theme", "drafts", "see_through")
    snapshot = Snapshot(context, context.earlier)

    def give(order: str, text: str) -> str:
        if order not in set(Order):
            return f"{order!r} is not an order"
        return context.give(SUPERVISOR, Order(order), text)

    keys = [{"key": key, "does": does} for key, does in KEYS]
    room = Room(snapshot.parts(), keys, give, context.close)
    with room.add_slot("form"):
        ConsentCard(context, SUPERVISOR).build()
        Form(context, SUPERVISOR).build()
    with room.add_slot("reports"):
        Reports(context, SUPERVISOR).build()
    with room.add_slot("machine"):
        SceneView(context).build()
    with room.add_slot("cameras"):
        Cameras(context).build()

    def update() -> None:
        parts: dict[str, Any] = snapshot.parts()
        room.show(parts)

    ui.timer(RATE_S, update)
