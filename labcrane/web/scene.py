"""The machine in three dimensions: its links as they look, targets, cues and what stands around."""

import math
from collections.abc import Mapping, Sequence

from nicegui import ui

from labcrane.core.primitives import Shape
from labcrane.core.records import Run
from labcrane.machines.links import link_boxes
from labcrane.machines.machine import Body, Machine
from labcrane.web.control_room.model import MachineModel, span
from labcrane.web.page import PageContext
from labcrane.web.surroundings import Surroundings

RATE_S = 0.1
BACKGROUND = "#27303b"
"""Neither glares in a dim laboratory nor hides the machine on a bright desk."""

CAMERAS: Mapping[str, tuple[float, float, float]] = {
    "free": (1.1, -1.6, 1.1),
    "side": (0.0, -2.2, 0.4),
    "above": (0.01, -0.01, 2.4),
    "behind": (-1.6, 0.0, 0.9),
}
"""Where cameras stand, as shares of the machine's reach; any can be moved with the mouse."""


def camera_buttons(scenes: "Sequence[MachineScene]") -> None:
    """Build a button for each camera where the page stands; it turns all scenes."""

    def look(name: str) -> None:
        for scene in scenes:
            scene.look(name)

    with ui.row().classes("gap-2 mb-2").props('role=group aria-label="Cameras"'):
        for name in CAMERAS:
            button = ui.element("button").classes("room-button")
            button.props(f'type=button id="look-{name}"').on("click", lambda _, at=name: look(at))
            button.add_slot("default", f"<span>{name}</span>")


class MachineScene:
    """A machine and what is around it, in a scene that is built where the page stands.

    Parameters
    ----------
    about
        What the scene shows, for people who do not see it.
    """

    def __init__(self, machine: Machine, bodies: Sequence[Body], about: str) -> None:
        self._span = span(machine)
        with ui.element("div").classes("w-full").props(f'role=img aria-label="{about}"'):
            grid = round(2 * self._span), 20
            self._canvas = ui.scene(grid=grid, background_color=BACKGROUND).classes("w-full")
        self.look("free", seconds=0.0)
        self._around = Surroundings(self._canvas)
        self._draw(machine, bodies)

    def take(self, machine: Machine, bodies: Sequence[Body]) -> None:
        """Draw another machine in its place, at rest."""
        self._model.remove()
        self._draw(machine, bodies)

    def look(self, name: str, seconds: float = 0.5) -> None:
        """Look from one of the cameras."""
        x, y, z = (self._span * share for share in CAMERAS[name])
        self._canvas.move_camera(x=x, y=y, z=z, look_at_z=0.2 * self._span, duration=seconds)

    def show(self, frame: Mapping[str, float], shapes: Sequence[Shape], things: str) -> None:
        """Show a frame, by its columns, with the shapes and things around the machine."""
        angles = [frame.get(f"state.joint.angle.{name}", math.nan) for name in self._names]
        if all(map(math.isfinite, angles)):
            state = {name.removeprefix("state."): value for name, value in frame.items()}
            self._model.place(angles, state)
        self._model.show(shapes)
        self._around.update(things, frame)

    def _draw(self, machine: Machine, bodies: Sequence[Body]) -> None:
        self._names = machine.names
        self._model = MachineModel(self._canvas, machine, bodies)
        self._model.place(machine.rest, {})


class SceneView:
    """Follows a session: pose, targets, cues and what stands around."""

    def __init__(self, context: PageContext) -> None:
        self._context = context

    def build(self) -> None:
        """Build it where the page stands, and keep it up to date."""
        machine = self._context.study.machine
        scenes: list[MachineScene] = []
        camera_buttons(scenes)
        about = "The machine as the session has it"
        self._scene = MachineScene(machine, link_boxes(machine), about)
        scenes.append(self._scene)
        self._run: Run | None = None
        ui.timer(RATE_S, self._update)

    def _update(self) -> None:
        context, run = self._context, self._context.shown.run
        if run is not None and run is not self._run:  # what the machine really looks like
            self._run = run
            self._scene.take(run.machine, run.bodies)
        newest = context.live.newest
        self._scene.show(newest, context.shown.shapes(newest), context.session.things)
