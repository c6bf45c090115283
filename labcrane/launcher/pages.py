"""The pages of a run, and their links in the terminal."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.errors import ProtocolError
from labcrane.session.commands import QueueConsole

if TYPE_CHECKING:
    from labcrane.launcher.launcher import Launcher, Outcome
    from labcrane.protocol.pages import PageSettings
    from labcrane.session.visit import Visit
    from labcrane.streams.sync.report.sync_report import SyncReport
    from labcrane.web.state import SessionLeft


LEVELS = {"PASS": "ok", "WARN": "warn", "FAIL": "bad"}
LOOPBACK = ("127.0.0.1", "::1", "localhost")


@contextmanager
def pages(
    visit: "Visit",
    launcher: "Launcher",
    console: QueueConsole,
    say: Callable[[str], None],
    *,
    feedback: bool,
) -> Iterator[None]:
    """Serve both pages while a run lasts; their links are printed when they can be opened.

    ``feedback`` is whether views and sounds are started.
    """
    from labcrane.feedback.processes import cameras_of
    from labcrane.web.handle import PageHandle, free_port
    from labcrane.web.service import PageConfig

    where = visit.study.protocol.page
    order = PageConfig(
        visit.study.path,
        visit.participant,
        visit.folder.name,
        visit.session,
        visit.source,
        where.host,
        free_port(where.host, where.port),
        cameras_of(visit.study) if feedback else {},
        *_tls(visit.study.path, where),
        recorded=visit.study.recorded,
        data=visit.folder.path,
    )
    if where.host not in LOOPBACK and order.certificate is None:
        say(
            f"the pages are served on {where.host} without TLS: others on that network can read "
            "them; set page: certificate and key"
        )
    handle = PageHandle(order, console.give, say, lambda: launcher.streams_status)
    console.listeners.append(handle.tell)
    try:
        yield
    finally:
        handle.close(left_behind(visit, launcher.outcome, launcher.sync_report))


def left_behind(
    visit: "Visit", outcome: "Outcome | None", report: "SyncReport | None"
) -> "SessionLeft":
    """Return the texts for the experimenter at the end of a run; no outcome means an error."""
    from labcrane.streams.sync.report.sync_report import COLUMNS
    from labcrane.web.state import SessionLeft

    file = visit.folder.participant_file
    saved = []
    if file.exists():
        saved.append(f"participant file: {file} ({file.stat().st_size / 1e6:.1f} MB)")
    journals = [path for path in sorted(visit.journal.parent.glob("*")) if path.is_file()]
    saved += [f"journal: {path}" for path in journals if path != file]
    if not saved:
        saved.append("nothing: the session had not begun")
    level, verdict, remedy = _verdict(visit, outcome, report)
    table = tuple(report.table()) if report else ()
    advice = tuple(report.advice()) if report else ()
    return SessionLeft(
        level, verdict, remedy, tuple(saved), COLUMNS if table else (), table, advice
    )


def _verdict(
    visit: "Visit", outcome: "Outcome | None", report: "SyncReport | None"
) -> tuple[str, str, str]:
    """Return how a run ended, in words, and what to do."""
    again = f"to continue, run: {visit.resume_command}"
    if outcome is None:
        return "bad", "The run ended with an error", "the terminal says which"
    if outcome.died is not None:
        where = f" in {outcome.where}" if outcome.where else ""
        return "bad", f"The session died{where}; what it recorded until then is saved", again
    level = LEVELS[report.verdict.value if report else "PASS"]
    doubt = "; the operator saw or heard too little" if report and report.presented else ""
    if report and report.interrupted:
        doubt += "; it was paused for a view or sound that had failed"
    if report and LEVELS[report.of_stamps.value] != "ok":
        doubt += "; check its timestamps"
    if outcome.owed:
        worst = "warn" if level == "ok" else level
        return (
            worst,
            f"The session is saved but incomplete{doubt}; remaining: {outcome.owed}",
            again,
        )
    return level, f"The session is complete and saved{doubt}", "see below" if doubt else ""


def _tls(protocol: Path, where: "PageSettings") -> tuple[Path | None, Path | None]:
    """Return the certificate and key with which the pages are served, None without TLS.

    Raises
    ------
    ProtocolError
        They are not there, or do not belong together.
    """
    if where.certificate is None or where.key is None:
        return None, None
    from labcrane.protocol.pages import unserved

    certificate, key = protocol.parent / where.certificate, protocol.parent / where.key
    if why := unserved(certificate, key):
        raise ProtocolError(why)
    return certificate, key
