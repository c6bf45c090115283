"""The hardware of components, looked at by the plugins that know it.

Each look is made in a process of its own: a driver that crashes or hangs is a finding.
"""

import faulthandler
import multiprocessing
import os
import re
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from pydantic import ValidationError

from labcrane.core.findings import Finding, Verdict
from labcrane.core.settings import Settings
from labcrane.processes.pipe import PipeEnd
from labcrane.protocol.study import Study
from labcrane.registry.hookspecs import ROLES
from labcrane.registry.registry import Registry, discover

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
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    wait_s = WAIT_S * (10.0 if move else 1.0)
    arguments = (theirs, look, move, str(complaints), wait_s)
    process = context.Process(target=_look, args=arguments, name=f"examine {look.name}")
    process.start()
    theirs.close()
    try:
        if not ours.poll(wait_s + START_S):
            return [_fault(look, f"did not answer within {wait_s + START_S:g} s")]
        found: Sequence[Finding] = ours.recv()
    except EOFError:
        process.join()
        text = complaints.read_text(encoding="utf-8", errors="replace")
        if TIMEOUT in text:
            return [_fault(look, f"did not answer within {wait_s:g} s{_stuck(text)}")]
        *_, last = ["", *text.splitlines()]
        why = f"; the last it said was {last.strip()!r}" if last else ""
        return [_fault(look, f"ended its process with exit code {process.exitcode}{why}")]
    else:
        return found
    finally:
        ours.close()
        process.join(1.0)
        if process.is_alive():
            process.kill()
            process.join()


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


def _look(
    pipe: PipeEnd,
    look: Look,
    move: bool,  # noqa: FBT001
    complaints: str,
    wait_s: float,
) -> None:
    # Sound libraries fill the terminal with what they did not find; it is kept for a crash.
    with Path(complaints).open("a", encoding="utf-8") as file:
        os.dup2(file.fileno(), sys.stderr.fileno())
    registry = discover(study=look.study)
    (role,) = (role for role, entry in ROLES.items() if entry.word == look.role)
    examine = registry.offers[role][look.name].examine
    assert examine is not None  # noqa: S101 - why it is looked at
    # Even what hangs in C and lets no Python run is seen by this, and ended.
    faulthandler.dump_traceback_later(wait_s, exit=True, file=sys.stderr)
    try:
        found = list(examine(look.settings, _say if move else None))
    except Exception as error:  # noqa: BLE001 - a plugin's look can raise anything
        found = [_fault(look, f"raised {type(error).__name__}: {error}")]
    pipe.send(found)


def _say(text: str) -> None:
    print(f"  {text}", flush=True)  # noqa: T201 - to the person who moves things
