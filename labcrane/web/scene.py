"""The machine in three dimensions: its links as they look, targets, cues and what stands around."""

from collections.abc import Mapping

from labcrane.core.records import Run
from labcrane.machines.links import link_boxes
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


class SceneView:
    """Follows a session: pose, targets, cues and what stands around."""

    def __init__(self, context: PageContext) -> None:
        self._context = context

    def build(self) -> None:
        """Build it where the page stands, and keep it up to date."""
        from nicegui import ui  # noqa: PLC0415 - loads for a second

        machine = self._context.study.machine
        self._span = span(machine)
        with ui.row().classes("gap-2 mb-2").props('role=group aria-label="Cameras"'):
            for name in CAMERAS:
                ui.element("button").classes("room-button").props(
                    f'type=button id="look-{name}"'
                ).on("click", lambda _, name=name: self._look(name)).add_slot(
                    "default", f"<span>{name}</span>"
                )
        with (
            ui.element("div")
            .classes("w-full")
            .props('role=img aria-label="The machine as the session has it"')
        ):
            self._canvas = ui.scene(
                grid=(round(2 * self._span), 20), background_color=BACKGROUND
            ).classes("w-full")
        self._look("free", seconds=0.0)
        self._surroundings = Surroundings(self._canvas)
        self._model = MachineModel(self._canvas, machine, link_boxes(machine))
        self._model.place(machine.rest, {})
        self._run: Run | None = None
        self._placed: tuple[object, ...] = ()
        ui.timer(RATE_S, self._update)

    def _look(self, name: str, seconds: float = 0.5) -> None:
        x, y, z = (self._span * share for share in CAMERAS[name])
        self._canvas.move_camera(x=x, y=y, z=z, look_at_z=0.2 * self._span, duration=seconds)

    def _update(self) -> None:
        context = self._context
        machine, newest = context.study.machine, context.live.newest
        self._follow_run()
        angles = [newest.get(f"state.joint.angle.{name}") for name in machine.names]
        given = [angle for angle in angles if angle is not None]
        if len(given) == len(angles) and (*given,) != self._placed:
            self._placed = (*given,)
            state = {
                name.removeprefix("state."): value
                for name, value in newest.items()
                if name.startswith("state.")
            }
            self._model.place(given, state)
        self._model.show(context.shown.shapes(newest))
        self._surroundings.update(context.session.things, newest)

    def _follow_run(self) -> None:
        """Draw what the machine really looks like, as soon as the session has told."""
        run = self._context.shown.run
        if run is not None and run is not self._run:
            self._run, self._placed = run, ()
            self._model.remove()
            self._model = MachineModel(self._canvas, run.machine, run.bodies)
            self._model.place(run.machine.rest, {})
