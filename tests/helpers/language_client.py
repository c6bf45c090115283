"""An editor, as a language server sees it: files are opened and saved, and marks come back."""

import json
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from urllib.parse import unquote

SETTINGS = {
    "yaml": {
        "validate": True,
        "hover": True,
        "completion": True,
        "schemaStore": {"enable": False},  # nothing is asked of the internet
    }
}


@dataclass(frozen=True, slots=True)
class Mark:
    """What an editor underlines, and shows beside it; lines and columns count from 1."""

    line: int
    column: int
    message: str
    severity: int


class Editor:
    """Speaks the Language Server Protocol with a server, over its standard streams.

    A server that never answers is ended by the test's own time-out.
    """

    def __init__(self, command: Sequence[str], folder: Path) -> None:
        self._command = command
        self._folder = folder
        self._number = 0
        self._versions: dict[str, int] = {}

    def __enter__(self) -> Self:
        self._server = subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=self._folder,
        )
        able = {"textDocument": {"hover": {}, "completion": {}, "publishDiagnostics": {}}}
        root = self._folder.as_uri()
        self._ask("initialize", processId=None, rootUri=root, capabilities=able)
        self._tell("initialized")
        self._tell("workspace/didChangeConfiguration", settings=SETTINGS)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._ask("shutdown")
            self._tell("exit")
            self._server.communicate(timeout=240)
            assert self._server.returncode == 0
        else:
            self._server.kill()
            self._server.communicate()

    def open(self, path: Path) -> list[Mark]:
        """Open a file as it is on the disk; return its marks."""
        text = path.read_text(encoding="utf-8")
        document = {"uri": path.as_uri(), "languageId": "yaml", "version": 1, "text": text}
        self._tell("textDocument/didOpen", textDocument=document)
        return self.marks(path)

    def save(self, path: Path) -> list[Mark]:
        """Save a file, which is on the disk already; return its marks."""
        self._tell("textDocument/didSave", textDocument={"uri": path.as_uri()})
        return self.marks(path)

    def marks(self, path: Path) -> list[Mark]:
        """Wait for the marks of a file."""
        while True:
            told = self._next("textDocument/publishDiagnostics")
            if unquote(told["uri"]) == unquote(path.as_uri()):
                return [_mark(each) for each in told["diagnostics"]]

    def hover(self, path: Path, line: int, column: int) -> str:
        """Return what is shown of the word at a place, counted from 1."""
        shown = self._at("textDocument/hover", path, line, column)
        return str(shown["contents"]["value"]) if shown else ""

    def complete(self, path: Path, line: int, column: int) -> list[str]:
        """Return what may stand at a place, counted from 1."""
        offered = self._at("textDocument/completion", path, line, column)
        return [str(each["label"]) for each in offered["items"]]

    def _at(self, method: str, path: Path, line: int, column: int) -> Any:
        position = {"line": line - 1, "character": column - 1}
        return self._ask(method, textDocument={"uri": path.as_uri()}, position=position)

    def _ask(self, method: str, **params: Any) -> Any:
        self._number += 1
        self._send(id=self._number, method=method, **({"params": params} if params else {}))
        while True:
            answer = self._read()
            if answer.get("id") == self._number and "method" not in answer:
                assert "error" not in answer, answer
                return answer["result"]

    def _tell(self, method: str, **params: Any) -> None:
        self._send(method=method, **({} if method == "exit" else {"params": params}))

    def _next(self, method: str) -> Any:
        while True:
            said = self._read()
            if said.get("method") == method:
                return said["params"]

    def _send(self, **message: Any) -> None:
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        assert self._server.stdin is not None
        self._server.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self._server.stdin.flush()

    def _read(self) -> dict[str, Any]:
        """Return what the server says next; what it asks of the editor is answered first."""
        assert self._server.stdout is not None
        length = 0
        while header := self._server.stdout.readline().strip():
            name, _, value = header.partition(b":")
            if name.lower() == b"content-length":
                length = int(value)
        assert length, "the server has ended"
        said: dict[str, Any] = json.loads(self._server.stdout.read(length))
        if "id" in said and "method" in said:
            asked = said.get("params") or {}
            given = [SETTINGS.get(each.get("section")) for each in asked.get("items", ())]
            self._send(id=said["id"], result=given or None)
        return said


def _mark(told: dict[str, Any]) -> Mark:
    start = told["range"]["start"]
    return Mark(start["line"] + 1, start["character"] + 1, told["message"], told["severity"])
