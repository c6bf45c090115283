"""Problem report: the files of an archive for a bug report, with nothing of people in them.

What goes in is listed here: versions of libraries that labcrane needs, names and times of its own
events, numbers, and places in its own code. No text that a person, a study or an error wrote goes
in.
"""

import json
import math
import os
import platform
import re
import sys
import traceback
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from labcrane.core.findings import Verdict
from labcrane.doctor.report import Diagnosis
from labcrane.doctor.versions import commit, liblsl, libraries
from labcrane.errors import RecordingError
from labcrane.files.atomic import replacing
from labcrane.recording.crash_marker import crash_marker_path, read_crash_marker
from labcrane.recording.foreign_streams import read_streams
from labcrane.recording.journal_reader import JournalState, SessionLog, read_journal
from labcrane.recording.paths import journal_path, parts, session_of
from labcrane.registry.entry_points import entry_points_of
from labcrane.registry.hookspecs import PROJECT

EVENTS = frozenset(
    [
        "session.start", "session.died", "session.failed", "session.resumed", "session.end",
        "step.start", "step.end", "block.start", "block.end", "trial.start", "trial.end",
        "break.start", "break.end", "pause.start", "pause.end", "plugin.slow", "input.lost",
        "input.back", "disk.lost", "disk.back", "stream.lost", "stream.back", "signal.bad",
        "signal.good", "feedback.awaited", "feedback.ready", "feedback.lost", "trigger.lost",
        "trigger.flood", "trigger.back", "page.denied", "launcher.gone", "loop.stalled",
    ]
)  # fmt: skip
"""Events of a session that go in."""

NUMBERS = (
    "died_in_tick", "step", "block", "trial", "attempt", "paused", "late_ticks", "worst_lateness",
    "seconds", "calls", "waited", "worst_s", "computed_s", "tick_s", "left_out",
)  # fmt: skip
"""Fields of these events that go in where they are numbers, or yes and no."""

ABOUT = ("rate_hz", "simulated", "pilot", "fast", "resumed")
"""What goes in of a session's context, where it is a number, or yes and no."""

AREAS = (
    "version", "clock", "scheduling", "screen", "disk", "windows", "scheme", "lsl", "engine",
    "input", "machine", "task", "trigger", "view", "sound", "feedback",
)  # fmt: skip
"""Areas of the doctor's checks that go in, without what they name after a space."""

TEXTS = ("clock", "scheduling")
"""Areas whose texts quote nothing that a person named."""

OTHER = "(another)"
"""Takes the place of a name that is not labcrane's."""

README = """\
Problem report of labcrane.

It has versions and the verdicts of labcrane doctor. Of one session it has the events of the
program, when steps and trials began and ended, and the state of the journals. Of an error it has
its type and the places in labcrane's code, but not its message.
It has no pseudonyms, answers, notes, results, positions, names, paths or texts of a study: if a
message explains the fault, read it and send it beside this file.
"""


@dataclass(frozen=True, slots=True)
class FoundSession:
    """A session whose journals are there.

    Attributes
    ----------
    folder
        The participant's folder.
    number
        Which session.
    """

    folder: Path
    number: int


def find_session(folder: Path, number: int | None = None) -> FoundSession | None:
    """Return the session below a folder that was written to last; None where there is none.

    Raises
    ------
    RecordingError
        There is none with this number.
    """
    found: dict[tuple[Path, int], float] = {}
    for path in folder.rglob("ses-*.xdf"):
        if (named := session_of(path)) is not None:
            key = (path.parent, named[0])
            found[key] = max(found.get(key, 0.0), path.stat().st_mtime)
    chosen = [key for key in found if number in {None, key[1]}]
    if number is not None and not chosen:
        there = ", ".join(map(str, sorted({each for _, each in found}))) or "none"
        raise RecordingError(
            f"there is no journal of session {number} below {folder}; there is {there}: give "
            "another --session, or another folder with --data"
        )
    if not chosen:
        return None
    return FoundSession(*max(chosen, key=lambda key: (found[key], str(key[0]), key[1])))


def compose(
    found: Diagnosis | None, trouble: Sequence[Exception], session: FoundSession | None
) -> dict[str, str]:
    """Return the files of the archive by name.

    Parameters
    ----------
    found
        What the doctor found; None if it found nothing, because it failed.
    trouble
        What kept the study from being read, or the doctor from its work.
    session
        Whose journals go in; None for none.
    """
    missing = [] if found else ["what labcrane doctor finds: it failed"]
    files = {"versions.txt": versions, "doctor.json": lambda: _json(_findings(found, trouble))}
    if session is not None:
        log, states, unread = _read(session)
        missing += [f"a journal of the session: {kind}" for kind in unread]
        files |= {
            "session/about.json": lambda: _json(_about(session, log, states, unread)),
            "session/events.jsonl": lambda: "".join(
                f"{json.dumps(each)}\n" for each in _events(log)
            ),
        }
    made = {name: _tried(name, make, missing) for name, make in files.items()}
    lines = "".join(f"Missing: {each}.\n" for each in missing)
    return {"README.txt": f"{README}\n{lines}" if lines else README} | made


def _tried(what: str, make: Callable[[], str], missing: list[str]) -> str:
    """Return what is made; nothing after adding it to what is missing, and why."""
    try:
        return make()
    except Exception as error:  # noqa: BLE001 - any fault may be what the report is about
        missing.append(f"{what}: it cannot be made ({_type(error)})")
        return ""


def versions() -> str:
    """Return versions of the system, of labcrane, and of libraries; no place and no other name."""
    clone = re.search(r"commit ([0-9a-f]+(?:-dirty)?)$", commit(Path(__file__).parents[2]))
    release, lsl = (
        "".join(re.findall(found, text))
        for found, text in ((r"^[\d.]+", platform.release()), (r"^liblsl [\d.]+", liblsl()))
    )
    return "\n".join(
        [
            f"{platform.system()} {release} {platform.machine()}",
            f"Python {platform.python_version()}",
            f"{PROJECT}, commit {clone[1]}" if clone else f"{PROJECT}, no clone",
            lsl,
            *(each.partition("+")[0] for each in [f"{PROJECT} {version(PROJECT)}", *libraries()]),
            "",
        ]
    )


@cache
def _ours() -> Mapping[str, str]:
    """Return the plugins that come with labcrane, and its own package, by their modules."""
    points = entry_points_of(PROJECT)
    of = {one.module: one.name for one in points if one.dist and one.dist.name == PROJECT}
    return {PROJECT: PROJECT, **of}


def places(error: BaseException) -> list[str]:
    """Return the type of an error, of those that led to it, and where in labcrane they occurred."""
    lines, due = list[str](), [error]
    while due:
        one = due.pop()
        lines += [_type(one), *map(_frame, traceback.extract_tb(one.__traceback__))]
        due += [each for each in (one.__cause__ or one.__context__,) if each is not None]
    return lines


def _type(error: BaseException) -> str:
    """Return the name of a type of error of labcrane's or Python's own."""
    module = type(error).__module__.partition(".")[0]
    known = module in _ours() or module in sys.stdlib_module_names
    return type(error).__name__ if known else OTHER


def _frame(frame: traceback.FrameSummary) -> str:
    """Return a place in labcrane's own code; of any other code nothing."""
    package = Path(__file__).parents[1]
    for root in (package.parent, package.parent / "plugins"):
        inside = Path(frame.filename)
        if inside.is_relative_to(root) and (inside := inside.relative_to(root)).parts[0] in _ours():
            return f"  {inside.as_posix()}, line {frame.lineno}, in {frame.name}"
    return f"  {OTHER}"


def check_new(path: Path) -> None:
    """Raise :class:`RecordingError` where there is a file with the name of the archive."""
    if os.path.lexists(path):
        raise RecordingError(f"{path} is there already; give another name with --to")


def write(files: Mapping[str, str], path: Path) -> None:
    """Write the archive, whose entries say neither when nor by whom they were made.

    Raises
    ------
    RecordingError
        It cannot be written.
    """
    with replacing(path) as beside, zipfile.ZipFile(beside, "w") as archive:
        for name, text in files.items():
            archive.writestr(zipfile.ZipInfo(name), text.encode(), zipfile.ZIP_DEFLATED)


def _json(value: object) -> str:
    return json.dumps(value, indent=1) + "\n"


def _read(
    session: FoundSession,
) -> tuple[SessionLog, list[JournalState], dict[str, Exception]]:
    """Return what the journals say, and what could not be read: that may be the problem."""
    log, states, unread = SessionLog(), list[JournalState](), dict[str, Exception]()
    for kind in ("run", "streams"):
        paths = parts(journal_path(session.folder, session.number, kind))
        try:
            if kind == "run":
                log, found = read_journal(paths)
            else:
                _, found = read_streams(paths)
        except Exception as error:  # noqa: BLE001 - any fault may be what the report is about
            unread[kind] = error
        else:
            states += found
    return log, states, unread


def _findings(found: Diagnosis | None, trouble: Sequence[Exception]) -> dict[str, Any]:
    failed = {"failed": [places(each) for each in trouble]}
    checks = found.as_data()["checks"] if found else ()
    lines = [_check(check["area"], check["verdict"], check["text"]) for check in checks]
    return failed | ({"checks": lines} if found else {})


def _check(area: str, verdict: str, text: str) -> dict[str, str]:
    """Return a verdict of the doctor, and its text where it quotes neither a name nor an error."""
    kind = area.partition(" ")[0]
    line = {"area": kind if kind in AREAS else OTHER, "verdict": str(Verdict(verdict))}
    return line | ({"text": text} if area in TEXTS and verdict != Verdict.FAIL else {})


def _about(
    session: FoundSession,
    log: SessionLog,
    states: Sequence[JournalState],
    unread: Mapping[str, Exception],
) -> dict[str, Any]:
    """Return what a session was made of, and how its journals were found."""
    marker = read_crash_marker(
        crash_marker_path(journal_path(session.folder, session.number, "run"))
    )
    plugin = marker.place.plugin if marker and marker.place else PROJECT
    return {
        "session": session.number,
        **_numbers(log.context, ABOUT),
        "journals": [asdict(each) | {"name": session_of(Path(each.name))} for each in states],
        "not_read": {kind: places(error) for kind, error in unread.items()},
        "died_in": marker and {"tick": marker.tick, "plugin": _plugin(plugin)},
    }


def _plugin(name: object) -> str:
    return str(name) if name in {*_ours(), *_ours().values()} else OTHER


def _numbers(data: Mapping[str, Any], names: Iterable[str]) -> dict[str, float]:
    """Return numbers, and yes and no, by their names."""
    return {name: data[name] for name in names if isinstance(data.get(name), int | float)}


def _events(log: SessionLog) -> Iterator[dict[str, Any]]:
    """Yield the events of the program, with seconds since the first one."""
    start = log.events[0].time if log.events else 0.0
    for event in log.events:
        if event.name in EVENTS:
            yield {
                "s": round(event.time - start, 6),
                "tick": int(event.tick) if math.isfinite(event.tick) else None,
                "part": event.part,
                "event": event.name,
                **_numbers(event.data, NUMBERS),
            }
