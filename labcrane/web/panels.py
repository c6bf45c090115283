"""Panels of the experimenter's page: loads in words, and the views' cameras."""

import math
from functools import partial
from typing import TYPE_CHECKING

from labcrane.machines.machine import Joint
from labcrane.session.commands import Order
from labcrane.web.page import PageContext

if TYPE_CHECKING:
    from nicegui import ui

LOAD = "state.joint.load"
SHARE = "1"
"""The unit of loads that are shares of the joints' efforts, with the sign of the torque."""


class Reports:
    """A button for each thing that the study's tasks ask about, while a trial runs.

    What is said to have arrived is what came back as an event.
    """

    def __init__(self, context: PageContext, page: str) -> None:
        self._context = context
        self._page = page

    def build(self) -> None:
        """Build them where the page stands, and keep them up to date."""
        from nicegui import ui  # noqa: PLC0415 - loads for a second

        tasks, words = self._context.study.tasks.values(), self._context.words(self._page)
        self._all = ui.row().classes("gap-3 items-center")
        with self._all:
            for what in dict.fromkeys(what for task in tasks for what in task.reports):
                ui.button(
                    words.about(words.seen, what),
                    on_click=partial(self._context.give, self._page, Order.REPORT, what),
                ).props(f'size=lg no-caps color=primary id="report-{what}"')
            self._said = ui.label().classes("text-lg").props('id="reported" role=status')
        self._update()
        ui.timer(RATE_S, self._update)

    def _update(self) -> None:
        session, words = self._context.session, self._context.words(self._page)
        self._all.set_visibility(bool(session.trial))
        self._said.set_text(", ".join(words.about(words.heard, one) for one in session.reported))


def said(load: float, unit: str, joint: Joint) -> str:
    """Return a load in words, with its torque where it is a share of the joint's effort."""
    if not math.isfinite(load):
        return "not known"
    if unit != SHARE:
        return f"{load:.1f} {unit}"
    return f"{load * joint.effort:.1f} N m, {100.0 * load:.1f} % of {joint.effort:g} N m"


RATE_S = 0.1


class Cameras:
    """A picture for each camera that a view sends, with its age; none that is out of date."""

    def __init__(self, context: PageContext) -> None:
        self._pictures = context.pictures

    def build(self) -> None:
        """Build it where the page stands, and keep it up to date."""
        from nicegui import ui  # noqa: PLC0415 - loads for a second

        for view, cameras in self._pictures.cameras.items():
            for camera in cameras:
                ident = f"camera-{view}-{camera}".replace(" ", "-")
                with ui.element("div").classes("w-full"):
                    ui.label(f"{view}: {camera}").classes("font-medium")
                    image = ui.element("img").classes("w-full")
                    image.props["id"], image.props["alt"] = ident, f"what camera {camera} shows"
                    line = ui.label().classes("font-mono text-sm")
                    line.props["id"] = f"{ident}-age"
                update = partial(self._update, view, camera, image, line)
                update()
                ui.timer(RATE_S, update)

    def _update(self, view: str, camera: str, image: "ui.element", line: "ui.label") -> None:
        shot, said = self._pictures.of(view, camera)
        line.set_text(said)
        image.set_visibility(shot is not None)
        if shot is not None and image.props.get("src") != shot.source:
            image.props["src"] = shot.source
            image.update()
