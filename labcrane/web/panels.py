"""Panels of the supervisor's page: loads in words, and the views' cameras."""

import math
from functools import partial
from typing import TYPE_CHECKING

from labcrane.machines.machine import Joint
from labcrane.web.page import PageContext

if TYPE_CHECKING:
    from nicegui import ui

LOAD = "state.joint.load"
SHARE = "1"
"""The unit of loads that are shares of the joints' efforts, with the sign of the torque."""


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
                with ui.card().classes("w-full"):
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
