"""Service of the start page: studies of one folder, the open one, and the commands that run.

Every request but the page itself is JSON. A request never names a path outside the folder, and a
study is written only after its text has been compared with the file.
"""

import contextlib
import json
import subprocess
import sys
import threading
import webbrowser
from collections.abc import Callable, Sequence
from dataclasses import asdict
from inspect import signature
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import labcrane.web.study
from labcrane.errors import LabcraneError, ProtocolError
from labcrane.files.atomic import SHARED_FILE, write_text
from labcrane.files.lock import held
from labcrane.files.study_folder import YAML
from labcrane.limits import LIMITS
from labcrane.start.document import (
    TEXTS,
    ApprovedError,
    Document,
    NewerFileError,
    drafted,
    is_protocol,
)
from labcrane.start.jobs import Job, OfferedCommand
from labcrane.start.recent import recent, remember
from labcrane.start.text import edited
from labcrane.web.server.access import START
from labcrane.web.server.serving import HOST, serve_here

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

HERE = Path(__file__).parent
DEPTH = ("*", "*/*", "*/*/*")
"""How deep studies are looked for in the folder."""

PATIENCE_S = 120.0
"""How long a check, a copy or the schema may take."""

STYLE = Path(labcrane.web.study.__file__).with_name("study.css")
ASSETS = {
    each.name: each
    for each in (*map(HERE.joinpath, ("start.js", "form.js", "start.css", "words.json")), STYLE)
}
"""The page's own files, and the style of the study's page."""

OPEN = ".labcrane-start"
"""The lock file of a study that is open: two start pages would share its drafts."""

BAD_REQUEST, NOT_FOUND, REFUSED = 400, 404, 409
PICTURES = {".png": "image/png"}


class Workspace:
    """All that one start page works on.

    Parameters
    ----------
    root
        The folder of the studies; no path outside it is opened, unless it was open before.
    scratch
        A folder for the output of commands.
    address
        Where this page is, for another one that is refused the same study.
    """

    def __init__(
        self,
        root: Path,
        shipped: Sequence[str],
        offered: Sequence[OfferedCommand],
        scratch: Path,
        address: str = "",
    ) -> None:
        self.root = root
        self.scratch = scratch
        self._address = address
        self._shipped = shipped
        self._offered = {each.name: each for each in offered}
        self._document: Document | None = None
        self._opened: dict[Path, Document] = {}
        self._held = contextlib.ExitStack()
        self._folder: Path | None = None
        self._jobs: list[Job] = []
        self._schemas: dict[Path, Any] = {}
        self._lock = threading.RLock()

    def requests(self) -> dict[str, Callable[..., Any]]:
        """Return what the page may ask for, by name."""
        return {
            "studies": self.studies, "open": self.open, "copy": self.copy, "show": self.show,
            "edit": self.edit, "splice": self.splice, "undo": self.undo, "redo": self.redo,
            "save": self.save, "reload": self.reload, "check": self.check, "schema": self.schema,
            "run": self.run, "job": self.job, "stop": self.stop, "look": self.look,
            "file": self.file, "plan": self.plan,
        }  # fmt: skip

    @property
    def document(self) -> Document:
        """The study that is open.

        Raises
        ------
        ProtocolError
            None is.
        """
        if self._document is None:
            raise ProtocolError("no study is open; open one, or copy one")
        return self._document

    def studies(self) -> dict[str, Any]:
        """Return the studies of the folder, those opened last, the shipped ones, the commands."""
        found = sorted(
            path
            for pattern in DEPTH
            for path in self.root.glob(f"{pattern}.y*ml")
            if path.suffix in YAML and is_protocol(path)
        )
        return {
            "root": str(self.root),
            "here": [path.relative_to(self.root).as_posix() for path in found],
            "recent": [str(path) for path in recent() if path.is_file()],
            "shipped": list(self._shipped),
            "commands": [asdict(each) for each in self._offered.values()],
            "open": self._document is not None,
            "jobs": [each.shown() for each in self._jobs],
            "folders": self._folders(),
        }

    def _folders(self) -> list[str]:
        """Return the folders in that of the open study: a command can be given a new one."""
        if self._document is None:
            return []
        return [each.name for each in self._document.study.parent.glob("*") if each.is_dir()]

    def open(self, path: str) -> dict[str, Any]:
        """Open a study of the folder, or one that was open before."""
        wanted = (self.root / path).resolve()
        if not wanted.is_relative_to(self.root) and wanted not in recent():
            raise ProtocolError(
                f"{wanted} is outside {self.root}; start labcrane with that study's folder"
            )
        with self._lock:
            if self._folder is None or not wanted.is_relative_to(self._folder):
                opened = Document.open(wanted)
                lock = self._hold(wanted.parent)
                self._held.close()
                self._held, self._folder = lock, wanted.parent
                self._opened = {wanted: opened}
            remember(wanted)
            return self._turn_to(wanted, wanted)

    def file(self, name: str, new: bool = False) -> dict[str, Any]:  # noqa: FBT001, FBT002 - a key of a request
        """Turn to a text file of the open study, or make it; what is unsaved elsewhere stays."""
        with self._lock:
            study = self.document.study
            wanted = (study.parent / name).resolve()
            hidden = wanted.name.startswith(".") or wanted.suffix not in TEXTS
            if hidden or not wanted.is_relative_to(study.parent):
                raise ProtocolError(
                    f"{name!r} cannot name a text file of this study; give a name such as "
                    f"instructions.md, which ends in one of {', '.join(sorted(TEXTS))}"
                )
            if new:
                if wanted.exists():
                    raise ProtocolError(f"{name} exists already; choose it from the files")
                write_text(wanted, "", SHARED_FILE)
            return self._turn_to(wanted, wanted if is_protocol(wanted) else study)

    def _turn_to(self, path: Path, study: Path) -> dict[str, Any]:
        opened = self._opened.get(path) or Document.open(path, study)
        opened.study = study
        if self._document is not None:  # a page of the file before is refused
            opened.revision = max(opened.revision, self._document.revision) + 1
        self._opened[path] = self._document = opened
        return self._shown()

    def _shown(self) -> dict[str, Any]:
        """Return all that the page shows of the open file, and the other files not saved."""
        folder = self.document.study.parent
        others = [each.relative_to(folder).as_posix() for each in self._others()]
        return {**self.document.shown(), "others": others}

    def _others(self) -> list[Path]:
        """Return the study's other files with a draft, also one that an earlier start has left."""
        folder = self.document.study.parent
        opened = {path for path, each in self._opened.items() if each.unsaved}
        below = {path for path in opened if path.is_relative_to(folder)}
        return sorted((drafted(folder) | below) - {self.document.path})

    def _hold(self, folder: Path) -> contextlib.ExitStack:
        """Hold a study's folder against other start pages, with the address of this one in it.

        Raises
        ------
        StorageError
            Another start page holds it, a folder above it, or one in it.
        """
        with contextlib.ExitStack() as held_here:
            path = folder / OPEN
            held_here.enter_context(held(path, _refusal(path)))
            near = [each / OPEN for each in folder.parents]
            near += [found for depth in DEPTH for found in folder.glob(f"{depth}/{OPEN}")]
            for other in near:
                if other.is_file() and other.parent != self._folder:
                    with held(other, _refusal(other)):
                        pass  # left by a page that was killed
            with path.open("a", encoding="utf-8") as file:
                file.write(f"{self._address}\n")
            return held_here.pop_all()

    def close(self) -> None:
        """Let go of the study that is open."""
        self._held.close()

    def copy(self, shipped: str, name: str) -> dict[str, Any]:
        """Copy a shipped study into the folder, by ``labcrane new-study``, and open it."""
        if Path(name).name != name or name.startswith("."):
            raise ProtocolError(f"{name!r} cannot name a folder; give a name such as my_study")
        said = self._labcrane(["new-study", "--", shipped, name], self.root)
        if said.returncode:
            raise ProtocolError(said.stderr.strip().removeprefix("labcrane: "))
        line = f"labcrane new-study {shipped} {name}"
        return {**self.open(f"{name}/protocol.yaml"), "line": line}

    def show(self) -> dict[str, Any]:
        """Return the open study as it stands."""
        return self._shown()

    def edit(
        self, revision: int, how: str, place: list[str | int], value: Any = None
    ) -> dict[str, Any]:
        """Change one place."""
        with self._lock:
            document = self.document
            document.change(revision, edited(document.text, how, tuple(place), value))
            return self._shown()

    def splice(self, revision: int, begin: int, end: int, text: str) -> dict[str, Any]:
        """Put ``text`` in the place of the characters from ``begin`` to ``end``."""
        with self._lock:
            document = self.document
            before = document.text
            if not 0 <= begin <= end <= len(before):
                raise ProtocolError(f"the text has no characters {begin} to {end}")
            document.change(revision, before[:begin] + text + before[end:])
            return self._shown()

    def undo(self, revision: int) -> dict[str, Any]:
        """Take the last change back."""
        with self._lock:
            self.document.undo(revision)
            return self._shown()

    def redo(self, revision: int) -> dict[str, Any]:
        """Make it again."""
        with self._lock:
            self.document.redo(revision)
            return self._shown()

    def save(
        self, revision: int, over_newer: bool = False, over_approved: bool = False,  # noqa: FBT001, FBT002 - keys of a request
        every: bool = False,  # noqa: FBT001, FBT002
    ) -> dict[str, Any]:  # fmt: skip
        """Write the file, or ``every`` one of the study; or return the question before that.

        Raises
        ------
        NewerFileError
            Another program has changed a file that is not in view.
        """
        with self._lock:
            document = self.document
            document.check_revision(revision)
            try:
                if document.unsaved or not every:
                    document.save(revision, over_newer=over_newer, over_approved=over_approved)
            except (NewerFileError, ApprovedError) as error:
                ask = "newer" if isinstance(error, NewerFileError) else "approved"
                return {**self._shown(), "ask": ask, "every": every}
            try:
                for path in self._others() if every else ():
                    study = path if is_protocol(path) else document.study
                    other = self._opened.get(path) or Document.open(path, study)
                    other.save(other.revision, over_approved=over_approved)
            except ApprovedError:
                return {**self._shown(), "ask": "approved", "every": every}
            except NewerFileError as error:
                error.add_note("choose that file in the list at the top, and save it")
                raise
            return self._shown()

    def reload(self, revision: int) -> dict[str, Any]:
        """Take the file as it is on the disk."""
        with self._lock:
            self.document.reload(revision)
            return self._shown()

    def check(self) -> dict[str, Any]:
        """Return what ``labcrane check`` finds in the study as it is now."""
        document, path, revision = self._study()
        said = self._labcrane(["check", path.name, "--json"], path.parent)
        try:
            told = json.loads(said.stdout.splitlines()[-1])
        except (IndexError, ValueError):
            raise ProtocolError(f"labcrane check failed: {said.stderr.strip()}") from None
        findings = [
            {**each, "message": each["message"].replace(path.name, document.study.name)}
            for each in told["findings"]
        ]
        return {"revision": revision, "fine": told["fine"], "findings": findings}

    def plan(self) -> dict[str, Any]:
        """Return what ``labcrane plan`` plans for each participant, and how balanced it is."""
        document, path, _ = self._study()
        said = self._labcrane(["plan", path.name, "--json"], path.parent)
        if said.returncode:
            why = said.stderr.strip().removeprefix("labcrane: ")
            raise ProtocolError(why.replace(path.name, document.study.name))
        line = f"labcrane plan {document.study.name}"
        return {**json.loads(said.stdout), "line": line}

    def _study(self) -> tuple[Document, Path, int]:
        """Return the open file, the protocol with its unsaved text, and the revision."""
        with self._lock:
            document = self.document
            protocol = self._opened.get(document.study)
            path = protocol.draft if protocol and protocol.unsaved else document.study
            return document, path, document.revision

    def schema(self) -> Any:
        """Return the JSON Schema of protocols, with the plugins in the study's folder."""
        path = self.document.study
        if path not in self._schemas:
            said = self._labcrane(["schema", "--study", path.name], path.parent)
            if said.returncode:
                said = self._labcrane(["schema"], path.parent)
            self._schemas[path] = json.loads(said.stdout)
        return self._schemas[path]

    def run(self, revision: int, command: str, given: dict[str, Any]) -> dict[str, Any]:
        """Start a command in the study's folder, once every file of the study is saved."""
        if command not in self._offered:
            raise ProtocolError(f"the page does not offer labcrane {command!r}")
        with self._lock:
            self.document.check_revision(revision)
            shown = self._shown()
            if unsaved := [shown["name"]] * shown["unsaved"] + shown["others"]:
                raise ProtocolError(f"not saved: {', '.join(unsaved)}; save it, then run again")
            number = len(self._jobs)
            words = self._offered[command].words(given)
            job = Job(number, words, self.document.study.parent, self.scratch / f"{number}.txt")
            self._jobs.append(job)
            return job.shown()

    def job(self, number: int) -> dict[str, Any]:
        """Return a command's output, and the pictures it has named."""
        job = self._job(number)
        shown = job.shown()
        pictures = [
            path.relative_to(job.folder).as_posix()
            for path in sorted(job.folder.glob("*/*.png"))
            if path.parent.name in shown["line"] and path.stat().st_mtime >= job.begun
        ]
        return {**shown, "pictures": pictures}

    def stop(self, number: int) -> dict[str, Any]:
        """Interrupt a command."""
        self._job(number).stop()
        return self._job(number).shown()

    def look(self, number: int, path: str) -> dict[str, Any]:
        """Open a report of a command in the browser, as a file: not as this page."""
        report = self._below(number, path, {".html"})
        if report is None:
            raise ProtocolError(f"there is no report {path!r} in the study's folder")
        webbrowser.open(report.as_uri())
        return {}

    def picture(self, number: int, path: str) -> Path | None:
        """Return a picture below the folder of a command; None where there is none."""
        return self._below(number, path, set(PICTURES))

    def _below(self, number: int, path: str, suffixes: set[str]) -> Path | None:
        if not 0 <= number < len(self._jobs):
            return None
        folder = self._jobs[number].folder.resolve()
        wanted = (folder / path).resolve()
        there = wanted.is_relative_to(folder) and wanted.suffix in suffixes and wanted.is_file()
        return wanted if there else None

    def still_running(self) -> list[str]:
        """Return the lines of commands that have not ended."""
        return [each.line for each in self._jobs if each.runs]

    def _job(self, number: int) -> Job:
        if not 0 <= number < len(self._jobs):
            raise ProtocolError(f"no command has the number {number}")
        return self._jobs[number]

    @staticmethod
    def _labcrane(words: Sequence[str], folder: Path) -> subprocess.CompletedProcess[str]:
        try:
            return subprocess.run(  # noqa: S603 - labcrane itself, without a shell
                [sys.executable, "-P", "-m", "labcrane", *words],
                cwd=folder, capture_output=True, encoding="utf-8", check=False, timeout=PATIENCE_S,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise ProtocolError(
                f"labcrane {words[0]} took longer than {PATIENCE_S:g} s; try it in a terminal"
            ) from None


def _refusal(path: Path) -> str:
    there = path.read_text(encoding="utf-8").splitlines()[1:] if path.is_file() else []
    where = " ".join(there) or "elsewhere"
    return f"{path.parent} is open in another labcrane start, {where}; go on there, or end that one"


def serve(
    root: Path,
    shipped: Sequence[str],
    offered: Sequence[OfferedCommand],
    port: int,
    say: Callable[[str], None],
) -> None:
    """Serve the start page to this computer until it is interrupted; ``say`` receives its link."""
    with TemporaryDirectory(prefix="labcrane-start-", ignore_cleanup_errors=True) as scratch:
        address = f"http://{HOST}:{port}/{START}"
        workspace = Workspace(root, shipped, offered, Path(scratch), address)
        with contextlib.closing(workspace):
            serve_here(application(workspace), START, port, say, LIMITS["YAML file"].most)
        for line in workspace.still_running():
            say(f"still running: {line}")


def application(workspace: Workspace) -> Any:
    """Return the page and its requests, an ASGI application."""
    from starlette.applications import Starlette  # noqa: PLC0415 - loads for a while
    from starlette.concurrency import run_in_threadpool  # noqa: PLC0415
    from starlette.responses import FileResponse, JSONResponse, PlainTextResponse  # noqa: PLC0415
    from starlette.routing import Route  # noqa: PLC0415

    requests = workspace.requests()
    fresh = {"cache-control": "no-store"}

    async def page(_: "Request") -> "Response":
        return FileResponse(HERE / "start.html", headers=fresh)

    async def asset(request: "Request") -> "Response":
        found = ASSETS.get(request.path_params["name"])
        if found is None:
            return PlainTextResponse("labcrane: no such file", NOT_FOUND)
        return FileResponse(found, headers=fresh)

    async def picture(request: "Request") -> "Response":
        found = workspace.picture(request.path_params["number"], request.path_params["path"])
        if found is None:
            return PlainTextResponse("labcrane: no such picture", NOT_FOUND)
        return FileResponse(found, headers=fresh, media_type=PICTURES[found.suffix])

    async def ask(request: "Request") -> "Response":
        try:
            answers = requests[request.path_params["name"]]
            given = signature(answers).bind(**json.loads(await request.body() or b"{}"))
        except (KeyError, TypeError, ValueError) as error:
            return JSONResponse({"error": f"not a request of this page: {error}"}, BAD_REQUEST)
        try:
            answer = await run_in_threadpool(answers, *given.args, **given.kwargs)
        except LabcraneError as error:
            lines = [str(error), *getattr(error, "__notes__", ())]
            return JSONResponse({"error": "\n".join(lines)}, REFUSED, fresh)
        except OSError as error:
            return JSONResponse({"error": str(error)}, REFUSED, fresh)
        plain = json.loads(json.dumps(answer, default=str), parse_constant=str)  # .nan and .inf
        return JSONResponse(plain, headers=fresh)

    return Starlette(
        routes=[
            Route(f"/{START}", page),
            Route("/asset/{name}", asset),
            Route("/picture/{number:int}/{path:path}", picture),
            Route("/ask/{name}", ask, methods=["POST"]),
        ]
    )
