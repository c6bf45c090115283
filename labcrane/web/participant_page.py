"""The participant's page: consent, the questionnaire that is asked, what may be reported."""

from pathlib import Path

from nicegui import ui

from labcrane.web.form import ConsentCard, Form
from labcrane.web.page import PageContext, prepare
from labcrane.web.panels import Reports
from labcrane.web.server.access import PARTICIPANT

STYLE = Path(__file__).with_name("form.css")


def participant_page(context: PageContext) -> None:
    """Build the page."""
    page = context.study.protocol.page
    ui.page_title(context.study.protocol.title or "labcrane")
    ui.colors(primary=page.colour)
    ui.add_css(STYLE)
    prepare(page.language, "drafts")
    with ui.column().classes("form-page w-full max-w-4xl mx-auto p-4 gap-4"):
        with ui.element("h1").classes("form-study"):
            ui.label(context.study.protocol.title or context.study.protocol.study)
        ConsentCard(context, PARTICIPANT).build()
        Form(context, PARTICIPANT).build()
        Reports(context, PARTICIPANT).build()
