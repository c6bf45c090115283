"""Service of the study's page: the overview, every session's viewer, and the newest report."""

import asyncio
from collections.abc import Callable
from datetime import date, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from labcrane.errors import LabcraneError
from labcrane.participants.folders import Places
from labcrane.participants.register import read
from labcrane.recording.participant_file.writer import DAMAGED
from labcrane.recording.paths import participant_path
from labcrane.registry.registry import Registry
from labcrane.web.server.access import STUDY
from labcrane.web.server.serving import AWAY_S, build_pages, serve_here
from labcrane.web.study.overview import Reader, newest_report
from labcrane.web.study.study_page import page_of
from labcrane.web.viewer.codes import Opening
from labcrane.web.viewer.film import Film
from labcrane.web.viewer.opened import opened

NOT_FOUND, BROKEN = 404, 500
PATIENCE_S = 60.0
"""How long a recording may take to open."""


def serve(
    reader: Reader, registry: Callable[[], Registry], port: int, say: Callable[[str], None]
) -> None:
    """Serve the study's page to this computer until it is interrupted; ``say`` receives its link.

    ``registry`` gives what draws recorded cues, when the first recording is looked at.
    """
    from fastapi import FastAPI  # noqa: PLC0415 - loads for a second

    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    with TemporaryDirectory(prefix="labcrane-study-") as scratch:
        _routes(app, reader, registry, Path(scratch))
        build_pages(app)
        serve_here(app, STUDY, port, say)


def _routes(app: Any, reader: Reader, registry: Callable[[], Registry], scratch: Path) -> None:
    from fastapi import Response  # noqa: PLC0415
    from fastapi.responses import FileResponse, HTMLResponse, PlainTextResponse  # noqa: PLC0415
    from nicegui import ui  # noqa: PLC0415

    from labcrane.web.viewer.viewer import viewer_page  # noqa: PLC0415

    @app.get(f"/{STUDY}")  # type: ignore[untyped-decorator]  # app may be any ASGI app
    def study() -> Response:
        """Give the page as the study stands now."""
        made = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M")
        try:
            text = page_of(reader.overview(date.today()), date.today(), made)
        except (LabcraneError, *DAMAGED) as error:
            return PlainTextResponse(f"labcrane: {error}", BROKEN)
        return HTMLResponse(text, headers={"cache-control": "no-store"})

    @app.get("/report/{path:path}")  # type: ignore[untyped-decorator]  # as above
    def report(path: str) -> Response:
        """Return a file of the latest report, and no other file."""
        try:
            folder = newest_report(read(Places(reader.data)))
        except LabcraneError as error:
            return PlainTextResponse(f"labcrane: {error}", BROKEN)
        if folder is not None:
            wanted = (folder / path).resolve()
            if wanted.is_relative_to(folder.resolve()) and wanted.is_file():
                return FileResponse(wanted)
        return PlainTextResponse(f"labcrane: the report has no {path!r}", NOT_FOUND)

    @ui.page("/viewer", response_timeout=PATIENCE_S, reconnect_timeout=AWAY_S)
    async def viewer(person: str, session: int = 1, beside: str = "") -> None:
        people = [person, *([beside] if beside else [])]
        try:
            films = [
                await asyncio.to_thread(_film, reader.data, one, session, scratch) for one in people
            ]
        except (LabcraneError, *DAMAGED) as error:
            ui.label(f"{person}, session {session} cannot be shown: {error}").props("role=alert")
            return
        viewer_page(films, registry(), Opening())


def _film(data: Path, person: str, session: int, scratch: Path) -> Film:
    """Return a recording as it can be looked at; a name that is none of a folder there is refused.

    Raises
    ------
    RecordingError
        There is none, or nothing is in it.
    """
    folder = next((each for each in data.iterdir() if each.name == person), data / "nobody")
    said: list[str] = []
    file = participant_path(folder)
    record = opened(file, session, scratch / f"{session}", said.append)
    return Film(record, f"{person} ({'; '.join(said)})" if said else person, (file, session))
