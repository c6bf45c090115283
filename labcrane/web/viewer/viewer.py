"""Viewer's page: the machine as it was recorded, with its timeline and its signals."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from labcrane.errors import LabcraneError, RecordingError
from labcrane.recording.participant_file.writer import DAMAGED
from labcrane.registry.registry import Registry
from labcrane.web.control_room.model import MachineModel, span
from labcrane.web.control_room.shown import ShownShapes
from labcrane.web.page import PRIMARY, SEE_THROUGH, prepare
from labcrane.web.scene import BACKGROUND, CAMERAS
from labcrane.web.server.access import VIEWER
from labcrane.web.server.serving import AWAY_S, build_pages, serve_here
from labcrane.web.surroundings import Surroundings
from labcrane.web.viewer.film import Film
from labcrane.web.viewer.glances import Glances
from labcrane.web.viewer.marks import Marks

HERE = Path(__file__).parent

Asked = Mapping[str, Any]
Answer = Callable[[Asked], Asked]


class Screen:
    """The machine of one film in three dimensions."""

    def __init__(self, film: Film, shapes: ShownShapes) -> None:
        self._film = film
        self._shapes = shapes

    def build(self) -> None:
        """Build it where the page stands."""
        from nicegui import ui  # noqa: PLC0415 - loads for a second

        film, reach = self._film, span(self._film.machine)
        with ui.element("div").props(f'role=img aria-label="{film.called}: the machine"'):
            ui.label(film.called).classes("font-medium")
            canvas = ui.scene(grid=(round(2 * reach), 20), background_color=BACKGROUND)
            canvas.classes("w-full")
        x, y, z = (reach * share for share in CAMERAS["free"])
        canvas.move_camera(x=x, y=y, z=z, look_at_z=0.2 * reach, duration=0.0)
        self._canvas = canvas
        self._model = MachineModel(canvas, film.machine, film.run.bodies)
        self._around = Surroundings(canvas)
        self.show(0.0)

    def look(self, name: str) -> None:
        """Look from one of the cameras."""
        reach = span(self._film.machine)
        x, y, z = (reach * share for share in CAMERAS[name])
        self._canvas.move_camera(x=x, y=y, z=z, look_at_z=0.2 * reach, duration=0.3)

    def show(self, at: float) -> None:
        """Show a time, in seconds from the film's start."""
        at += self._film.shift
        frame, situation = self._film.frame(at), self._film.situation(at)
        names = self._film.machine.names
        angles = [frame.get(f"state.joint.angle.{name}", math.nan) for name in names]
        if all(map(math.isfinite, angles)):
            state = {
                name.removeprefix("state."): value
                for name, value in frame.items()
                if name.startswith("state.")
            }
            self._model.place(angles, state)
        self._shapes.situate(situation)
        self._model.show(self._shapes.shapes(frame))
        self._around.update(situation.scene if situation.trial else "", frame)


def viewer_page(films: Sequence[Film], registry: Registry, at: float) -> None:
    """Build the page: one machine for each film, side by side at the same second."""
    from nicegui import ui  # noqa: PLC0415

    from labcrane.web.control_room.element import STYLE  # noqa: PLC0415
    from labcrane.web.viewer.element import Timeline  # noqa: PLC0415

    first = films[0]
    ui.page_title(f"{first.called} · labcrane")
    ui.colors(primary=PRIMARY)
    ui.add_css(STYLE)
    ui.add_css(HERE / "viewer.css")
    prepare("en", SEE_THROUGH)
    screens, lacking = [], []
    for film in films:
        cues, why = film.cues(registry)
        shapes = ShownShapes(cues)
        shapes.take(film.run)
        screens.append(Screen(film, shapes))
        lacking += [*why, *(f"stream {name!r} {what}" for name, what in film.unmeasured)]

    def show(second: float) -> str:
        try:
            for screen in screens:
                screen.show(second)
        except (LabcraneError, *DAMAGED) as error:
            return f"second {second:g} cannot be shown: {error}"
        return ""

    def look(name: str) -> None:
        for screen in screens:
            screen.look(name)

    marks, glances = Marks(first), first.glances
    about = {
        "title": " and ".join(film.called for film in films),
        "said": f"{len(first.trials)} attempts at trials, {len(first.events)} events, "
        f"{first.length / 60:.1f} min at {first.run.rate_hz:g} Hz",
        "lacking": lacking,
        "length": first.length,
        "rate": first.run.rate_hz,
        "at": at,
        "trials": first.trials,
        "events": first.events,
        "gaps": first.gaps,
        "breaks": first.breaks,
        "signals": first.signals,
        **marks.shown(),
        "gaze": glances.known,
    }
    line = Timeline(about, show, _answers(first, marks, glances))
    with line.add_slot("machine"):
        with ui.row().classes("gap-2 mb-2").props('role=group aria-label="Cameras"'):
            for name in CAMERAS:
                ui.element("button").classes("room-button").props(f"type=button id=look-{name}").on(
                    "click", lambda _, name=name: look(name)
                ).add_slot("default", f"<span>{name}</span>")
        with ui.element("div").classes("view-machines"):
            for screen in screens:
                screen.build()


def _answers(film: Film, marks: Marks, glances: Glances) -> dict[str, Answer]:
    """Return what answers each kind of question of the page; none of them raises."""
    units = {(one["stream"], one["column"]): one["unit"] for one in film.signals}

    def signal(asked: Asked) -> tuple[str, str, float, float]:
        span = float(asked["begin"]), float(asked["end"])
        return str(asked["stream"]), str(asked["column"]), *span

    def curve(asked: Asked) -> Asked:
        stream, column, begin, end = signal(asked)
        return {**film.curve(stream, column, begin, end), "unit": units[stream, column]}

    def spectrogram(asked: Asked) -> Asked:
        try:
            return film.spectrogram(*signal(asked))
        except RecordingError as error:
            return {"why": str(error)}

    def second(asked: Asked) -> Asked:
        return glances.as_json(float(asked["t"])) if glances.known else {}

    def lane(asked: Asked) -> Asked:
        return {"lane": glances.lane(float(asked["begin"]), float(asked["end"]))}

    def told(answer: Answer) -> Answer:
        def given(asked: Asked) -> Asked:
            try:
                return answer(asked)
            except (LabcraneError, *DAMAGED) as error:
                return {"failed": f"{asked['kind']}: not read: {error}"}

        return given

    answers: dict[str, Answer] = {"curve": curve, "spectrogram": spectrogram, "second": second}
    answers |= {"lane": lane, "mark": marks.asked}
    return {kind: told(answer) for kind, answer in answers.items()}


def serve(
    films: Sequence[Film], registry: Registry, port: int, at: float, say: Callable[[str], None]
) -> None:
    """Serve the viewer to this computer until it is interrupted; ``say`` receives its link."""
    from fastapi import FastAPI  # noqa: PLC0415
    from nicegui import ui  # noqa: PLC0415

    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)

    @ui.page("/viewer", reconnect_timeout=AWAY_S)
    def viewer() -> None:
        viewer_page(films, registry, at)

    build_pages(app)
    serve_here(app, VIEWER, port, say)
