"""Page context: what every page knows, and how it asks."""

from collections.abc import Callable
from dataclasses import dataclass

from labcrane.design.plan import SessionPlan
from labcrane.protocol.study import Study
from labcrane.session.commands import Command, Order
from labcrane.web.access import PARTICIPANT, RIGHTS
from labcrane.web.live import Live
from labcrane.web.pictures import Pictures
from labcrane.web.state import SessionView
from labcrane.web.translations import WORDS, Words

PRIMARY = "#0d47a1"
"""The pages' colour for what has the focus, 8.6 to 1 on white; the usual one is too faint."""


@dataclass(frozen=True)
class PageContext:
    """The session as pages see it.

    Attributes
    ----------
    send
        Passes a command on to the launcher.
    participant
        Name of the participant's folder: a pseudonym with its stamps.
    """

    study: Study
    plan: SessionPlan
    participant: str
    board: SessionView
    live: Live
    pictures: Pictures
    send: Callable[[Command], None]

    def words(self, page: str) -> Words:
        """Return the words of a page; the supervisor's is English."""
        return WORDS[self.study.protocol.page.language if page == PARTICIPANT else "en"]

    def give(self, page: str, order: Order, text: str = "") -> bool:
        """Pass on what a page asks; refuse and log what it has no right to. Whether it went."""
        if order not in RIGHTS[page]:
            why = f"the {page} page asked for {order.value}: no right to order it"
            self.send(Command(Order.DENIED, why, page))
            return False
        self.send(Command(order, text, page))
        return True
