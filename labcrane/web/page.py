"""Page context: what every page knows, and how it asks."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from labcrane.design.plan import SessionPlan
from labcrane.limits import LIMITS
from labcrane.protocol.pages import Language
from labcrane.protocol.study import Study
from labcrane.session.commands import Command, Order, beyond_limits
from labcrane.web.control_room.earlier import Earlier
from labcrane.web.control_room.shown import ShownShapes
from labcrane.web.live import Live
from labcrane.web.pictures import Pictures
from labcrane.web.server.access import NAMES, PARTICIPANT, RIGHTS
from labcrane.web.server.denials import Bucket
from labcrane.web.state import SessionView
from labcrane.web.translations import WORDS, Words

MOST_ORDERS_S = LIMITS["orders of one page"].most

HERE = Path(__file__).parent

BEAT_S = 0.5
"""How often each page hears from its server."""

PRIMARY = "#0d47a1"
"""The pages' colour for what has the focus, 8.6 to 1 on white; the usual one is too faint."""


@dataclass(frozen=True)
class PageContext:
    """The session as pages see it.

    Attributes
    ----------
    send
        Passes a command on to the launcher.
    denied
        Told of what was refused.
    shown
        The shapes to be seen next to the machine.
    earlier
        What was measured before, to compare the newest movements with.
    close
        Ends the pages, when the experimenter has seen the end.
    buckets
        How many orders each page may give now.
    participant
        Name of the participant's folder: a pseudonym with its stamps.
    """

    study: Study
    plan: SessionPlan
    participant: str
    session: SessionView
    live: Live
    pictures: Pictures
    send: Callable[[Command], None]
    denied: Callable[[str], None]
    shown: ShownShapes
    earlier: Earlier
    close: Callable[[], None]
    buckets: dict[str, Bucket] = field(
        default_factory=lambda: {page: Bucket(MOST_ORDERS_S, 2 * MOST_ORDERS_S) for page in RIGHTS}
    )

    def words(self, page: str) -> Words:
        """Return the words of a page; the experimenter's is English."""
        return WORDS[self.study.protocol.page.language if page == PARTICIPANT else "en"]

    def give(self, page: str, order: Order, text: str = "", at: str | None = None) -> str:
        """Pass on what a page asks, or refuse and log it; return why, or nothing when it went.

        ``at`` is the address from which it was asked, that of the browser by default.
        """
        at = _address() if at is None else at
        command = Command(order, text, page, at)
        if order not in RIGHTS[page]:
            why: str | None = "no right to order it"
        elif not self.buckets[page].take():
            why = f"more than {MOST_ORDERS_S} actions per second"
        else:
            why = beyond_limits(command)
        if why is None:
            self.send(command)
            return ""
        why = f"the {NAMES[page]}'s page asked for {order.value}: {why}"
        self.denied(why)
        return why


def prepare(language: Language, *scripts: str) -> None:
    """Prepare the page that is being built, with the scripts of these names.

    It states its language, by which screen readers pronounce, and when it is stale.
    """
    from nicegui import ui  # noqa: PLC0415

    about = f"lang = {language!r}; root.dataset.staleWords = {json.dumps(WORDS[language].stale)}"
    ui.add_head_html(f"<script>{{const root = document.documentElement; root.{about}}}</script>")
    ui.add_css(HERE / "stale.css")
    for name in ("stale", *scripts):
        script = (HERE / name).with_suffix(".js").read_text(encoding="utf-8")
        ui.add_head_html(f"<script>{script}</script>")
    ui.timer(BEAT_S, lambda: ui.run_javascript("labcraneBeat()"))


def _address() -> str:
    """Return the address of the browser whose event is handled now."""
    from nicegui import context  # noqa: PLC0415 - loads for a second

    return str(context.client.ip)
