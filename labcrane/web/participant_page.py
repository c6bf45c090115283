"""The participant's page: consent, the questionnaire that is asked, what may be reported."""

from labcrane.web.door.access import PARTICIPANT
from labcrane.web.form import ConsentCard, Form
from labcrane.web.page import PRIMARY, PageContext
from labcrane.web.panels import Reports


def participant_page(context: PageContext) -> None:
    """Build the page."""
    from nicegui import ui  # noqa: PLC0415 - loads for a second

    ui.page_title("labcrane")
    ui.colors(primary=PRIMARY)
    with ui.column().classes("w-full max-w-4xl mx-auto p-4"):
        ConsentCard(context, PARTICIPANT).build()
        Form(context, PARTICIPANT).build()
        Reports(context, PARTICIPANT).build()
