"""The pages of a run, and their links in the terminal."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from labcrane.session.commands import QueueConsole

if TYPE_CHECKING:
    from labcrane.launcher.launcher import Launcher
    from labcrane.session.session import Visit


@contextmanager
def pages(
    visit: "Visit",
    launcher: "Launcher",
    console: QueueConsole,
    say: Callable[[str], None],
    *,
    feedback: bool,
) -> Iterator[None]:
    """Serve both pages while a run lasts; their links are printed once.

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
    )
    keeper = PageHandle(order, console.give, say, lambda: launcher.streams_status)
    console.listeners.append(keeper.tell)
    for page, link in keeper.links().items():
        say(f"{page} page: {link}")
    try:
        yield
    finally:
        report = launcher.sync_report
        rows = [" · ".join(row) for row in report.table()] + report.advice() if report else []
        keeper.close(rows)
