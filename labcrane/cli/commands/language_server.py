"""Command for editors: a language server that marks in a protocol what ``labcrane check`` finds."""

import re
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

from labcrane.errors import LabcraneError, PluginError

if TYPE_CHECKING:
    from lsprotocol.types import Diagnostic
    from pygls.lsp.server import LanguageServer

EDITOR = "pip install 'labcrane[editor]'"
"""How to install the language server."""

_PROTOCOL = re.compile(r"^labcrane\s*:", re.MULTILINE)


def language_server() -> None:
    """Mark what check finds in an editor, on opening and saving."""
    try:
        import pygls  # noqa: F401
    except ModuleNotFoundError as error:
        raise PluginError(f"this needs {error.name}, which is not installed: {EDITOR}") from None
    channel = sys.stdout.buffer
    with redirect_stdout(sys.stderr):  # what a plugin prints is not for the editor
        server().start_io(stdout=channel)


def findings(path: Path) -> Sequence[Mapping[str, Any]]:
    """Return ``findings`` of ``check --json``."""
    from labcrane.cli.commands.check import examined
    from labcrane.protocol.questions import about, problems

    try:
        study, asked = examined(path)
    except LabcraneError as error:
        return problems(error)
    return [about(study, each) for each in asked]


def server() -> "LanguageServer":
    """Return a server that checks protocols, and no other YAML files."""
    from importlib.metadata import version

    from lsprotocol import types
    from pygls.lsp.server import LanguageServer
    from pygls.uris import to_fs_path

    speaks = LanguageServer("labcrane", version("labcrane"))

    def look(uri: str) -> None:
        """Mark the findings in a protocol, and remove the marks of its last check."""
        path = Path(to_fs_path(uri) or "")
        if is_protocol(path):
            marks = [diagnostic(each) for each in findings(path)]
            speaks.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri, marks))

    @speaks.feature(types.TEXT_DOCUMENT_DID_OPEN)
    def opened(params: types.DidOpenTextDocumentParams) -> None:
        look(params.text_document.uri)

    @speaks.feature(types.TEXT_DOCUMENT_DID_SAVE)
    def saved(params: types.DidSaveTextDocumentParams) -> None:
        look(params.text_document.uri)

    return speaks


def is_protocol(path: Path) -> bool:
    """Whether a file is a protocol: it has the key ``labcrane``, or a protocol's file name."""
    if path.name == "protocol.yaml":
        return True
    try:
        return bool(_PROTOCOL.search(path.read_text(encoding="utf-8", errors="replace")))
    except OSError:
        return False  # not saved yet


def diagnostic(finding: Mapping[str, Any]) -> "Diagnostic":
    """Return a finding for editors: from its column, or the line's first one, to the line's end."""
    from lsprotocol import types

    line, column = finding["line"] - 1, max(0, finding["column"] - 1)
    question = finding["kind"] == "question"
    return types.Diagnostic(
        range=types.Range(types.Position(line, column), types.Position(line + 1, 0)),
        message=finding["message"],
        severity=types.DiagnosticSeverity.Warning if question else types.DiagnosticSeverity.Error,
        code=finding["key"] or None,
        source="labcrane",
    )
