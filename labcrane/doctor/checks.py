"""The complete examination of a computer, and the short one at the start of every session."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from labcrane.core.findings import Finding, Verdict
from labcrane.doctor import check_process, clock, components, disk, scheduling, screen, windows
from labcrane.doctor.check_process import Call
from labcrane.doctor.report import Check, Diagnosis, as_data, diagnosis, keep, latest
from labcrane.doctor.versions import versions
from labcrane.protocol.study import Study
from labcrane.registry.registry import Registry

RATE_HZ = 240.0
"""Ticks per second without a protocol."""

OTHERWISE = "close other programs and run doctor again; if it persists, send this with a bug report"
UNMOUNTED = "the server or disk that holds it does not answer: mount it again, or give --data"
UNPLUGGED = "check the network of this computer, or give --local"
"""Remedies if an examination does not answer."""


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
        The study that is checked; None checks everything.
    needed_bytes
        Space that a session needs.
    peers
        Other computers whose streams are needed, by name or address.
    move
        Whether a person is there to move the controls.
    """
    rate_hz = study.protocol.rate_hz if study else RATE_HZ
    yield from _checks("version", (Finding(Verdict.PASS, line) for line in versions()))
    for area, call in (
        ("clock", Call("the clock", OTHERWISE, clock.examine)),
        ("scheduling", Call("scheduling", OTHERWISE, scheduling.examine, (rate_hz,))),
        ("screen", Call("the screen", OTHERWISE, screen.examine)),
        ("disk", Call(f"folder {data}", UNMOUNTED, disk.examine, (data, needed_bytes))),
    ):
        yield from _checks(area, check_process.examine(call))
    if windows.APPLIES:
        settings = Call("settings of Windows", OTHERWISE, windows.examine, (data,))
        yield from _checks("windows", check_process.examine(settings))
    if study:
        yield from _checks("scheme", directions(study))
    looks = components.of_study(study, registry) if study else components.of_everything(registry)[0]
    for look in looks:
        yield from _checks(look.area, components.examine(look, move=move))
    yield from _network(study, peers)


def directions(study: Study) -> Iterator[Finding]:
    """Print the directions of the machine, so that the person at the controls can check them."""
    said = study.scheme.settings.directions(study.machine)
    return (Finding(Verdict.PASS, text) for text in said)


def left_out(registry: Registry, study: Study | None) -> Sequence[str]:
    """Return what is not checked, and how to check it."""
    return components.unexamined(study) if study else components.of_everything(registry)[1]


def keep_apart(found: Diagnosis, data: Path) -> Finding:
    """Store a diagnosis in the data folder; a folder that hangs or is not writable is a finding."""
    (finding,) = check_process.examine(Call(f"folder {data}", UNMOUNTED, _keep, (found, data)))
    return finding


def _keep(found: Diagnosis, data: Path) -> Iterator[Finding]:
    text = f"saved in {keep(found, data)}: sessions within a day include it in their records"
    yield Finding(Verdict.PASS, text)


def at_start(data: Path) -> dict[str, Any]:
    """Return the facts on the computer for a session's record, ready for JSON.

    They are facts that take no time to check, and this computer's last diagnosis if it was made
    within a day.
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
    expected = study.protocol.expected if study else ()
    requests = [
        need.request(label, required=need.required, expected=expected)
        for label, need in needs.items()
    ]
    streams = Call("LSL streams", UNPLUGGED, lsl.examine, (requests,))
    yield from _checks("lsl", check_process.examine(streams))
    for peer in peers:
        call = Call(f"peer {peer}", UNPLUGGED, lsl.ask_peer, (peer,))
        yield from _checks(f"lsl {peer}", check_process.examine(call))


def _checks(area: str, findings: Iterable[Finding]) -> Iterator[Check]:
    return (Check(area, finding) for finding in findings)
