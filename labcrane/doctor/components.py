"""The hardware of components, looked at by the plugins that know it.

Each look is made in a process of its own: a driver that crashes or hangs is a finding.
"""

import faulthandler
import importlib
import os
import pickle
import re
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from pydantic import ValidationError

from labcrane.core.findings import Finding, Verdict
from labcrane.core.settings import Settings
from labcrane.processes.handle import Patience, ProcessHandle
from labcrane.processes.parent import Parent
from labcrane.protocol.study import Study
from labcrane.registry.hookspecs import ROLES
from labcrane.registry.registry import Registry, discover

MODULE = "labcrane.doctor.components"

WAIT_S = 30.0
"""How long a look may take; with a person who moves things, ten times as long."""

START_S = 60.0
"""How much longer a process may take that has to start first, on a busy computer too."""

TIMEOUT = "Timeout ("
"""How faulthandler begins when the time of a look is over."""


@dataclass(frozen=True, slots=True)
class Look:
    """What is to be looked at.

    Attributes
    ----------
    area
        What the researcher calls it: ``view operator``.
    role
        The researcher's word for the component's role.
    name
        The component's name.
    settings
        As the protocol has them.
    study
        The protocol, beside which there may be plugins.
    """

    area: str
    role: str
    name: str
    settings: Settings
    study: Path | None = None


@dataclass(frozen=True, slots=True)
class LookConfig:
    """What the process of a look is told.

    Attributes
    ----------
    look
        Pickled: it can be read when the study's own plugins are there.
    study
        The protocol, beside which there may be plugins.
    move
        Whether a person is there to move things.
    complaints
        The file that takes what is written to the standard error.
    wait_s
        How long the look may take.
    """

    look: bytes
    study: Path | None
    move: bool
    complaints: Path
    wait_s: float


def of_study(study: Study, registry: Registry) -> list[Look]:
    """Return the looks that a study needs; ``registry`` is the one it was loaded with."""
    chosen = {
        f"input {study.input.name}": study.input,
        **{f"feedback {name}": choice for name, choice in (study.cues | study.sounds).items()},
        **{f"view {name}": choice for name, choice in study.views.items()},
    }
    words = {
        id(offer): ROLES[role].word
        for role, offers in registry.offers.items()
        for offer in offers.values()
    }
    return [
        Look(area, words[id(choice.offer)], choice.name, choice.settings, study.path)
        for area, choice in chosen.items()
        if choice.offer.examine is not None
    ]


def of_everything(registry: Registry) -> tuple[list[Look], list[str]]:
    """Return the looks at everything installed, and what needs a protocol to be looked at."""
    looks, left_out = [], []
    for role, offers in registry.offers.items():
        for name, offer in sorted(offers.items()):
            if offer.examine is None:
                continue
            word = ROLES[role].word
            try:
                looks.append(Look(f"{word} {name}", word, name, offer.settings()))
            except ValidationError:
                left_out.append(f"{word} {name}: give --protocol with a study that uses it")
    return looks, left_out


def examine(look: Look, *, move: bool) -> Sequence[Finding]:
    """Return what the plugin finds; ``move`` when a person is there to move things."""
    # A folder: Windows lets no second process open a temporary file that is open here.
    with tempfile.TemporaryDirectory(prefix="labcrane-doctor-") as folder:
        complaints = Path(folder) / "complaints"
        complaints.touch()
        return _examine(look, complaints, move=move)


def _examine(look: Look, complaints: Path, *, move: bool) -> Sequence[Finding]:
    wait_s = WAIT_S * (10.0 if move else 1.0)
    process = ProcessHandle(MODULE, f"examine {look.name}", Patience(stop_s=1.0))
    process.start(LookConfig(pickle.dumps(look), look.study, move, complaints, wait_s))
    ends = time.monotonic() + wait_s + START_S
    try:
        found = None
        while found is None and not process.ended and time.monotonic() < ends:
            process.wait(ends - time.monotonic())
            found = _taken(process)
        found = _taken(process) if found is None else found
        code = process.exit_code
    finally:
        process.stop()
    if found is not None:
        return found
    if code is None:
        return [_fault(look, f"did not answer within {wait_s + START_S:g} s")]
    text = complaints.read_text(encoding="utf-8", errors="replace")
    if TIMEOUT in text:
        return [_fault(look, f"did not answer within {wait_s:g} s{_stuck(text)}")]
    *_, last = ["", *text.splitlines()]
    why = f"; the last it said was {last.strip()!r}" if last else ""
    return [_fault(look, f"ended its process with exit code {code}{why}")]


def _taken(process: ProcessHandle) -> Sequence[Finding] | None:
    """Show what is for the person who moves things; return the findings once they have come."""
    found = None
    for message in process.messages():
        if isinstance(message, str):
            print(f"  {message}", flush=True)  # noqa: T201 - to the person who moves things
        else:
            found = message
    return found


def _fault(look: Look, what: str) -> Finding:
    fix = "look at its driver, or tell the plugin's author"
    return Finding(Verdict.FAIL, f"looking at {look.role} {look.name!r} {what}", fix)


FRAME = re.compile(r'^  File "(?P<path>.+)", line (?P<line>\d+) in (?P<name>.+)$', re.MULTILINE)


def _stuck(complaints: str) -> str:
    """Return where a look has stood still, as faulthandler wrote it at the end of its time.

    What hangs is most often a library; which call of the plugin's led there says more.
    """
    *_, main = complaints.rpartition("(most recent call first):")
    calls = list(takewhile(lambda call: call["path"] != __file__, FRAME.finditer(main)))
    if not calls:
        return ""
    inner, *outer = calls
    said = f"; it stood still in {inner['name']}() ({Path(inner['path']).name}:{inner['line']})"
    here = Path(inner["path"]).parent
    for call in outer:
        if Path(call["path"]).parent != here:
            place = f"{Path(call['path']).name}:{call['line']}"
            return f"{said}, called by {call['name']}() ({place})"
    return said


def main() -> int:
    """Look once; return the process's exit status."""
    parent = Parent()
    order: LookConfig | None = parent.order()
    if order is None:
        return 0
    # Sound libraries fill the terminal with what they did not find; it is kept for a crash.
    with order.complaints.open("a", encoding="utf-8") as file:
        os.dup2(file.fileno(), sys.stderr.fileno())
    registry = discover(study=order.study)
    look: Look = pickle.loads(order.look)  # noqa: S301 - of whoever started this process
    (role,) = (role for role, entry in ROLES.items() if entry.word == look.role)
    examine = registry.offers[role][look.name].examine
    assert examine is not None  # noqa: S101 - why it is looked at
    # Even what hangs in C and lets no Python run is seen by this, and ended.
    faulthandler.dump_traceback_later(order.wait_s, exit=True, file=sys.stderr)
    try:
        found = list(examine(look.settings, parent.tell if order.move else None))
    except Exception as error:  # noqa: BLE001 - a plugin's look can raise anything
        found = [_fault(look, f"raised {type(error).__name__}: {error}")]
    parent.tell(found)
    parent.close()
    return 0


if __name__ == "__main__":
    # What it sends is unpickled by the name of this module, which is not __main__.
    sys.exit(importlib.import_module("labcrane.doctor.components").main())
