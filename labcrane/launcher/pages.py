"""The pages of a run, and their links in the terminal."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.errors import ProtocolError
from labcrane.session.commands import QueueConsole

if TYPE_CHECKING:
    from labcrane.launcher.launcher import Launcher
    from labcrane.protocol.pages import PageSettings
    from labcrane.session.visit import Visit


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
        *_tls(visit.study.path, where),
        recorded=visit.study.recorded,
    )
    if where.host not in LOOPBACK and order.certificate is None:
        say(
            f"the pages are served on {where.host} without TLS: who listens on that network can "
            "read along; give page: certificate and key"
        )
    handle = PageHandle(order, console.give, say, lambda: launcher.streams_status)
    console.listeners.append(handle.tell)
    for page, link in handle.links().items():
        say(f"{page} page: {link}")
    try:
        yield
    finally:
        report = launcher.sync_report
        rows = [" · ".join(row) for row in report.table()] + report.advice() if report else []
        handle.close(rows)


def _tls(protocol: Path, where: "PageSettings") -> tuple[Path | None, Path | None]:
    """Return the certificate and key with which the pages are served, None without TLS.

    Raises
    ------
    ProtocolError
        They are not there, or do not belong together.
    """
    if where.certificate is None or where.key is None:
        return None, None
    import ssl

    certificate, key = protocol.parent / where.certificate, protocol.parent / where.key
    try:
        ssl.create_default_context(ssl.Purpose.CLIENT_AUTH).load_cert_chain(certificate, key)
    except (OSError, ValueError) as error:  # ssl's errors are OSErrors
        raise ProtocolError(
            f"the pages cannot be served with certificate {str(certificate)!r} and key "
            f"{str(key)!r}: {error}; give both in PEM, without a passphrase"
        ) from error
    return certificate, key
