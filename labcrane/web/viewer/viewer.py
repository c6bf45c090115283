"""Viewer's page: the machine as it was recorded, with its timeline and its signals."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from nicegui import ui

from labcrane.errors import LabcraneError, RecordingError
from labcrane.recording.participant_file.writer import DAMAGED
from labcrane.registry.registry import Registry
from labcrane.web.control_room.element import STYLE
from labcrane.web.control_room.shown import ShownShapes
from labcrane.web.page import PRIMARY, prepare
from labcrane.web.scene import MachineScene, camera_buttons
from labcrane.web.server.access import VIEWER
from labcrane.web.server.serving import AWAY_S, build_pages, serve_here
from labcrane.web.viewer.codes import TAKEN, Opening
from labcrane.web.viewer.element import Timeline
from labcrane.web.viewer.film import Film
from labcrane.web.viewer.glances import Glances
from labcrane.web.viewer.marks import Marks
from labcrane.web.viewer.pictures import SOUND_S, picture, sound

HERE = Path(__file__).parent


Asked = Mapping[str, Any]
Answer = Callable[[Asked], Asked]


class Screen:
    """The machine of one film in three dimensions."""

    def __init__(self, film: Film, shapes: ShownShapes) -> None:
        self._film = film
        self._shapes = shapes

    def build(self) -> MachineScene:
        """Build it where the page stands."""
        film = self._film
        with ui.element("div"):
            ui.label(film.called).classes("font-medium")
            self._scene = MachineScene(film.machine, film.run.bodies, f"{film.called}: the machine")
        self.show(0.0)
        return self._scene

    def show(self, at: float) -> None:
        """Show a time, in seconds from the film's start."""
        at += self._film.shift
        frame, situation = self._film.frame(at), self._film.situation(at)
        self._shapes.situate(situation)
        things = situation.scene if situation.trial else ""
        self._scene.show(frame, self._shapes.shapes(frame), things)


def viewer_page(films: Sequence[Film], registry: Registry, opening: Opening) -> None:
    """Build the page: one machine for each film, side by side at the same second."""
    first = films[0]
    ui.page_title(f"{first.called} · labcrane")
    ui.colors(primary=PRIMARY)
    ui.add_css(STYLE)
    ui.add_css(HERE / "viewer.css")
    prepare("en", "theme", "see_through")
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

    marks, glances = Marks(first), first.glances
    about = {
        "title": " and ".join(film.called for film in films),
        "said": f"{len(first.trials)} attempts at trials, {len(first.events)} events, "
        f"{first.length / 60:.1f} min at {first.run.rate_hz:g} Hz",
        "lacking": lacking,
        "length": first.length,
        "rate": first.run.rate_hz,
        "at": opening.at,
        "coder": opening.coder,
        "codes": list(opening.codes),
        "taken": TAKEN,
        "trials": first.trials,
        "events": first.events,
        "gaps": first.gaps,
        "breaks": first.breaks,
        "signals": first.signals,
        **marks.shown(),
        "gaze": glances.known,
        "filmed": list(first.footage),
        "soundLasts": SOUND_S,
    }
    line = Timeline(about, show, _answers(first, marks, glances))
    with line.add_slot("machine"):
        scenes: list[MachineScene] = []
        camera_buttons(scenes)
        with ui.element("div").classes("view-machines"):
            scenes += [screen.build() for screen in screens]


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
    answers |= {"picture": partial(picture, film), "sound": partial(sound, film)}
    return {kind: told(answer) for kind, answer in answers.items()}


def serve(
    films: Sequence[Film],
    registry: Registry,
    port: int,
    opening: Opening,
    say: Callable[[str], None],
) -> None:
    """Serve the viewer to this computer until it is interrupted; ``say`` receives its link."""
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)

    @ui.page("/viewer", reconnect_timeout=AWAY_S)
    def viewer() -> None:
        viewer_page(films, registry, opening)

    build_pages(app)
    serve_here(app, VIEWER, port, say)
