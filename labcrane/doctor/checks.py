"""The whole examination of a computer, and the light one at the start of every session."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from labcrane.core.findings import Finding, Verdict
from labcrane.doctor import clock, components, disk, scheduling
from labcrane.doctor.report import Check, as_data, diagnosis, latest
from labcrane.doctor.versions import versions
from labcrane.protocol.study import Study
from labcrane.registry.registry import Registry

RATE_HZ = 240.0
"""Ticks a second where no protocol says how many."""


def examine(
    data: Path,
    registry: Registry,
    study: Study | None,
    *,
    needed_bytes: float = disk.NEEDED_BYTES,
    peers: Sequence[str] = (),
    move: bool = False,
) -> Iterator[Check]:
    """Yield one finding after another, for a study or for everything that is installed.

    Parameters
    ----------
    data
        The data folder; it need not exist.
    study
        What is needed; None looks at everything.
    needed_bytes
        Space that a session takes.
    peers
        Other computers whose streams are needed, by name or address.
    move
        Whether a person is there to move the controls.
    """
    rate_hz = study.protocol.rate_hz if study else RATE_HZ
    yield from _checks("version", (Finding(Verdict.PASS, line) for line in versions()))
    yield from _checks("clock", clock.examine())
    yield from _checks("scheduling", scheduling.examine(rate_hz))
    yield from _checks("disk", disk.examine(data, needed_bytes))
    looks = components.of_study(study, registry) if study else components.of_everything(registry)[0]
    for look in looks:
        yield from _checks(look.area, components.examine(look, move=move))
    yield from _network(study, peers)


def left_out(registry: Registry, study: Study | None) -> Sequence[str]:
    """Return what is not looked at, and how it would be."""
    return () if study else components.of_everything(registry)[1]


def at_start(data: Path) -> dict[str, Any]:
    """Return what a session's record holds of the computer, ready for JSON.

    What can be seen without making anybody wait, and the last diagnosis of this computer when it
    was made within a day.
    """
    checks = [
        *_checks("clock", clock.light()),
        *_checks("scheduling", scheduling.light()),
        *_checks("disk", disk.light(data)),
    ]
    now = diagnosis(checks)
    return {
        "at_start": {"computer": now.computer, "checks": [as_data(check) for check in checks]},
        "examination": latest(data),
    }


def _network(study: Study | None, peers: Sequence[str]) -> Iterator[Check]:
    from labcrane.doctor import lsl  # noqa: PLC0415 - loads liblsl, which reads its configuration

    needs = study.protocol.streams if study else {}
    requests = [need.request(label, required=need.required) for label, need in needs.items()]
    yield from _checks("lsl", lsl.examine(requests))
    for peer in peers:
        yield from _checks(f"lsl {peer}", lsl.ask_peer(peer))


def _checks(area: str, findings: Iterable[Finding]) -> Iterator[Check]:
    return (Check(area, finding) for finding in findings)
