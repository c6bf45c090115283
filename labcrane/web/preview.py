"""Preview of the participant's pages: each text and questionnaire of a session, without a session.

What is answered is checked as in a session, and kept nowhere.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

from fastapi import FastAPI
from nicegui import ui

from labcrane.core.records import Event
from labcrane.design.plan import SessionPlan
from labcrane.protocol.study import Study
from labcrane.session.commands import Command, Order
from labcrane.session.questionnaire import QuestionnaireForm
from labcrane.session.stop_rules import Said
from labcrane.web.control_room.earlier import Earlier
from labcrane.web.control_room.shown import ShownShapes
from labcrane.web.live import Live
from labcrane.web.page import PageContext
from labcrane.web.participant_page import participant_page
from labcrane.web.pictures import Pictures
from labcrane.web.server.access import PARTICIPANT
from labcrane.web.server.serving import build_pages, serve_here
from labcrane.web.state import SessionView

SOURCE = "preview"
"""The name of a session that is not there."""

UNAPPROVED = "The participant reads and accepts the consent text that labcrane approve names."
NO_PAGE = "The session has no such page."


def previewed(study: Study, plan: SessionPlan) -> Iterator[tuple[str, str | None]]:
    """Yield each page of a participant: its title, and its text; None for a questionnaire."""
    for step in plan.steps:
        if step.kind == "consent":
            yield f"{step.number} {step.kind}", UNAPPROVED
        elif step.text:
            yield f"{step.number} {step.kind}", step.text
        for name in (*step.questionnaires, *(step.block.ask if step.block else ())):
            yield f"{step.number} {name}", None


class Filled:
    """A questionnaire that is filled in for a try: its answers are checked, and kept nowhere."""

    def __init__(self, study: Study, name: str, seed: int) -> None:
        self.view = SessionView()
        self._form = QuestionnaireForm(name, study.questionnaires[name], {}, seed=seed)
        self._hear(self._form.begin())

    def take(self, command: Command) -> None:
        """Take an answer, or the submission."""
        if command.order is Order.ANSWER:
            self._hear(self._form.take(command.text, PARTICIPANT))
        elif command.order is Order.SUBMIT and not self._form.over:
            self._hear(self._form.hand_in(PARTICIPANT))

    def _hear(self, said: Said) -> None:
        name, data = said
        self.view.take(Event(name, 0.0, data))


def serve(study: Study, plan: SessionPlan, port: int, say: Callable[[str], None]) -> None:
    """Serve the pages to this computer until it is interrupted; ``say`` receives their link."""
    pages = list(previewed(study, plan))
    context = PageContext(
        study, plan, plan.participant, SessionView(), Live(SOURCE), Pictures(SOURCE, {}),
        lambda _: None, say, ShownShapes(study.cues), Earlier(), close=lambda: None,
    )  # fmt: skip

    @ui.page(f"/{PARTICIPANT}")
    def participant(page: int = 1) -> None:
        with ui.row().classes("p-2 gap-4").props("role=navigation"):
            for at, (title, _) in enumerate(pages, start=1):
                now = "aria-current=page" if at == page else ""
                ui.link(title, f"/{PARTICIPANT}?page={at}").props(now).classes("text-blue-10")
        title, shown = pages[page - 1] if 0 < page <= len(pages) else ("", NO_PAGE)
        if shown is None:
            filled = Filled(study, title.partition(" ")[2], plan.seed)
            participant_page(replace(context, session=filled.view, send=filled.take))
        else:
            ui.label(shown).classes("whitespace-pre-wrap text-lg p-4").props('id="text"')

    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)

    build_pages(app)
    serve_here(app, PARTICIPANT, port, say)
