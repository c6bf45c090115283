"""The consent text on a page, and the button that confirms it."""

from labcrane.console import Order
from labcrane.supervisor.desk import Desk
from labcrane.supervisor.rights import PARTICIPANT

SIGNED = "The participant has signed this text"
"""What the supervisor confirms."""


class ConsentCard:
    """Shows the approved text and its version for as long as a consent to it is missing."""

    def __init__(self, desk: Desk, page: str) -> None:
        self._desk = desk
        self._page = page
        self._shown = ""

    def build(self) -> None:
        """Build it where the page stands, and keep it up to date."""
        from nicegui import ui  # noqa: PLC0415 - loads for a second

        self._area = ui.column().classes("w-full")
        ui.timer(0.1, self._update)

    def _update(self) -> None:
        version = str(self._desk.board.consent.get("version", ""))
        if version != self._shown:
            self._shown = version
            self._area.clear()
            if version:
                with self._area:
                    self._rebuild(version)

    def _rebuild(self, version: str) -> None:
        from nicegui import ui  # noqa: PLC0415

        asked, words = self._desk.board.consent, self._desk.words(self._page)
        with ui.card().classes("w-full").props('id="consent"'):
            ui.label(words.consent).classes("text-2xl font-medium").props("role=heading")
            ui.label(f"{asked['file']}, {words.version} {version}").props('id="consent-version"')
            if asked["text"]:
                ui.label(str(asked["text"])).classes("whitespace-pre-wrap text-lg")
            ui.link(f"{words.open_file} {asked['file']}", "/consent", new_tab=True).classes(
                "text-blue-10"
            )
            ui.button(
                words.take_part if self._page == PARTICIPANT else SIGNED,
                on_click=lambda: self._desk.give(self._page, Order.CONSENT, version),
            ).props('no-caps size=lg color=blue-10 id="order-consent"')
