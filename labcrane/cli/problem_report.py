"""Problem report: the files of an archive for a bug report, with nothing of people in them.

What goes in is named here, event by event and field by field; everything else stays out. Texts that
go in are cleaned: only words of labcrane's own source, versions and numbers stay.
"""

import json
import math
import os
import re
import traceback
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import distributions
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from labcrane.cli.cleaner import Cleaner
from labcrane.doctor.report import Diagnosis
from labcrane.doctor.versions import versions
from labcrane.errors import RecordingError
from labcrane.files.atomic import replacing
from labcrane.participants.folders import Places
from labcrane.participants.register import Register, read
from labcrane.protocol.protocol import Participants
from labcrane.recording.crash_marker import crash_marker_path, read_crash_marker
from labcrane.recording.data_folder import DataFolder
from labcrane.recording.foreign_streams import RecordedStream, read_streams
from labcrane.recording.journal_reader import JournalState, LoggedEvent, SessionLog, read_journal
from labcrane.recording.paths import journal_path, parts, session_of
from labcrane.registry.entry_points import one_name
from labcrane.registry.hookspecs import PROJECT

KEPT: Mapping[str, tuple[str, ...]] = {
    "session.start": (),
    "session.died": ("where", "died_in_tick"),
    "session.failed": ("why",),
    "session.resumed": ("after", "policy"),
    "session.end": ("reason",),
    "step.start": ("step", "kind"),
    "step.end": ("step", "kind", "done"),
    "block.start": ("block",),
    "block.end": ("block",),
    "trial.start": ("trial", "attempt"),
    "trial.end": ("trial", "attempt", "paused", "late_ticks", "worst_lateness"),
    "break.start": ("seconds",),
    "break.end": (),
    "pause.start": ("by",),
    "pause.end": ("by",),
    "plugin.slow": ("why", "calls", "waited", "worst_s", "computed_s", "tick_s"),
    "input.lost": ("why",),
    "input.back": (),
    "disk.lost": ("why",),
    "disk.back": (),
    "stream.lost": ("what",),
    "stream.back": ("what",),
    "signal.bad": ("stream", "channel", "kind"),
    "signal.good": ("stream", "channel", "kind"),
    "feedback.awaited": ("what",),
    "feedback.ready": ("what", "facts"),
    "feedback.lost": ("what", "why", "left_out"),
    "trigger.lost": ("trigger", "why"),
    "trigger.flood": ("trigger", "why"),
    "trigger.back": ("trigger",),
    "page.denied": ("why",),
    "launcher.gone": (),
}
"""Events of a session that go in, and what of each; all others are only counted."""

ABOUT = ("rate_hz", "simulated", "pilot", "fast", "resumed", "clock", "versions", "real_time")
"""What goes in of a session's context."""

WORST = 20
"""Ticks that are listed as the latest."""

MINUTE_S = 60.0

README = """\
Problem report of labcrane.

It has the findings of labcrane doctor, versions and what is installed. Of one session it has the
events of the program, when steps and trials began and ended, the timing of the loop and of streams,
and the state of the journals. It has no answers, notes, results, positions or gaze. Pseudonyms are
participant-1 and so on. Texts keep words of labcrane's own source, versions and numbers; quoted
values, paths, addresses and all other words are replaced.
"""

T = TypeVar("T")

NAMES = {
    "what": "name",
    "stream": "stream",
    "channel": "channel",
    "block": "block",
    "trigger": "trigger",
}
"""Fields of events whose texts a study chooses, by what they are replaced with."""


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


def people_of(folder: Path, missing: list[str]) -> tuple[set[str], set[str]]:
    """Return the pseudonyms of a data folder and of the one that it is in, and their patterns.

    A register that cannot be read is added to what is missing.
    """
    names, patterns = set[str](), set[str]()
    for root in (folder, folder.absolute().parent):
        there = partial(read, Places(root))
        register = _tried("the register", there, Register(), missing)
        names |= set(register.names())
        names |= {each for entry in register.participants.values() for each in entry.formerly}
        names |= {stone.participant for stone in register.tombstones}
        patterns |= {register.pattern} - {""}
    journals = [*folder.rglob("ses-*.xdf"), *folder.absolute().parent.glob("*/ses-*.xdf")]
    folders = {path.parent.name for path in journals}
    return names | {DataFolder.pseudonym(name) for name in folders}, patterns


def pattern_of(protocol: Path) -> set[str]:
    """Return patterns of pseudonyms in a protocol, also if it is not valid or not readable."""
    try:
        text = protocol.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return set()
    found = re.findall(r"""\bpattern:\s*(?:'([^'\n]*)'|"([^"\n]*)"|([^\s'"#,}][^\n#,]*))""", text)
    return {each for one in found for each in one if each} | {Participants().pattern}


def compose(
    found: Diagnosis | None,
    trouble: Sequence[str],
    session: FoundSession | None,
    folders: Sequence[Path],
    patterns: Iterable[str] = (),
) -> dict[str, str]:
    """Return the files of the archive by name.

    Parameters
    ----------
    found
        What the doctor found; None if it found nothing, because it failed.
    trouble
        What kept the study from being read, in words; empty for nothing.
    session
        Whose journals go in; None for none.
    folders
        The data folder first, then the study's.
    patterns
        Regular expressions of pseudonyms, beside those of the register.
    """
    missing = [] if found else ["what labcrane doctor finds: it failed"]
    people, more = set[str](), set[str]()
    if folders[0].is_dir():
        people, more = _tried(
            "pseudonyms of the data folder",
            lambda: people_of(folders[0], missing),
            (people, more),
            missing,
        )
    log, streams, states, unread = _read(session) if session else (SessionLog(), [], [], [])
    if log.context:
        people.add(DataFolder.pseudonym(str(log.context.get("participant", ""))))
    computers = _tried(
        "names of computers", lambda: list(_computers(log, streams)), list[str](), missing
    )
    computers += [found.computer] if found else []
    clean = Cleaner(people - {""}, computers, folders, {*patterns, *more})
    files = {
        "versions.txt": lambda: clean.text("\n".join([*versions(), ""]), versions=True),
        "installed.txt": installed,
        "doctor.json": lambda: _json(_findings(found, trouble, clean)),
    }
    if session is not None:
        files |= {
            "session/about.json": lambda: _json(_about(session, log, states, unread, clean)),
            "session/timing.json": lambda: _json(_timing(log)),
            "session/events.jsonl": lambda: "".join(
                f"{json.dumps(each, ensure_ascii=False)}\n" for each in _events(log, clean)
            ),
            "session/streams.json": lambda: _json([_stream(each, clean) for each in streams]),
        }
    made = {name: _tried(name, make, "", missing) for name, make in files.items()}
    missing += [f"a journal of the session: {each.partition(':')[0]}" for each in unread]
    lines = "".join(f"Missing: {each}.\n" for each in dict.fromkeys(missing))
    return {"README.txt": f"{README}\n{lines}" if lines else README} | made


def _tried(what: str, make: Callable[[], T], otherwise: T, missing: list[str]) -> T:
    """Return what is made, or something else after adding it to what is missing, and why."""
    try:
        return make()
    except Exception as error:  # noqa: BLE001 - any fault may be what the report is about
        # The type alone: its text may have names in it.
        missing.append(f"{what}: it cannot be read ({type(error).__name__})")
        return otherwise


def installed() -> str:
    """Return the installed packages that labcrane needs, and how many others there are."""
    there = {one_name(each.name): each for each in distributions() if each.name}
    reached, due = set[str](), [PROJECT]
    while due:
        name = one_name(due.pop())
        if name in there and name not in reached:
            reached.add(name)
            due += [
                match[0]
                for each in there[name].requires or ()
                if (match := re.match(r"[\w.-]+", each)) is not None
            ]
    lines = [f"{name}-{there[name].version.partition('+')[0]}" for name in sorted(reached)]
    return "\n".join([*lines, f"and {len(there) - len(reached)} others", ""])


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
    return json.dumps(value, indent=1, ensure_ascii=False) + "\n"


def _read(
    session: FoundSession,
) -> tuple[SessionLog, list[RecordedStream], list[JournalState], list[str]]:
    """Return what the journals say, and what could not be read: that may be the problem."""
    log, streams = SessionLog(), list[RecordedStream]()
    states, unread = list[JournalState](), list[str]()
    for kind in ("run", "streams"):
        paths = parts(journal_path(session.folder, session.number, kind))
        try:
            if kind == "run":
                log, found = read_journal(paths)
            else:
                streams, found = read_streams(paths)
        except Exception:  # noqa: BLE001 - any fault may be what the report is about
            unread.append(f"{kind}: {traceback.format_exc()}")
        else:
            states += found
    return log, streams, states, unread


def _computers(log: SessionLog, streams: Iterable[RecordedStream]) -> Iterator[str]:
    """Yield the names of the computers that recorded and that sent."""
    doctor = log.context.get("doctor") or {}
    for each in ("at_start", "examination"):
        yield str((doctor.get(each) or {}).get("computer", ""))
    yield from (stream.header.host for stream in streams)


def _findings(found: Diagnosis | None, trouble: Sequence[str], clean: Cleaner) -> dict[str, Any]:
    """Return what the doctor found, without what names other computers on the network."""
    why = [clean.text(each) for each in trouble]
    if found is None:
        return {"study_not_read": why}
    data = found.as_data()
    return {
        "study_not_read": why,
        "made": data["made"],
        "verdict": data["verdict"],
        "checks": _checks(data["checks"], clean),
        "left_out": clean.data(data["left_out"]),
    }


def _checks(checks: Iterable[Mapping[str, Any]], clean: Cleaner) -> list[dict[str, str]]:
    """Return lines of the doctor, but for those about streams of other computers."""
    cleaned = list[dict[str, str]]()
    for check in checks:
        area, text, advice = (str(check[name]) for name in ("area", "text", "advice"))
        if area.startswith("lsl") and text.startswith("stream "):
            absent = text.endswith("is not announced")
            text = "a stream is not announced" if absent else "(a stream of another computer)"
            advice = advice if absent else ""
        versions = area == "version"
        cleaned.append(
            {
                "area": clean.text(area),
                "verdict": str(check["verdict"]),
                "text": clean.text(text, versions=versions),
                "advice": clean.text(advice),
            }
        )
    return cleaned


def _about(
    session: FoundSession,
    log: SessionLog,
    states: Sequence[JournalState],
    unread: Sequence[str],
    clean: Cleaner,
) -> dict[str, Any]:
    """Return what a session was made of, and how its journals were found."""
    context = log.context
    marker, why = None, [clean.traceback(each) for each in unread]
    try:
        marker = read_crash_marker(
            crash_marker_path(journal_path(session.folder, session.number, "run"))
        )
    except Exception:  # noqa: BLE001 - any fault may be what the report is about
        why.append(clean.traceback(f"crash marker: {traceback.format_exc()}"))
    components = context.get("components", {})
    at_start = ((context.get("doctor") or {}).get("at_start") or {}).get("checks", [])
    about = {name: context[name] for name in ABOUT if name in context}
    kept = {
        name: clean.text(str(about.pop(name)), versions=True)
        if isinstance(about.get(name), str)
        else {
            clean.text(str(of)): clean.text(str(version), versions=True)
            for of, version in about.pop(name, {}).items()
        }
        for name in ("versions",)
        if name in about
    }
    return {
        "session": session.number,
        **clean.data(about),
        **kept,
        "components": {
            clean.text(part): {name: clean.data(each.get(name)) for name in ("use", "plugin")}
            for part, each in components.items()
        },
        "doctor_at_start": _checks(at_start, clean),
        "journals": [
            # The name of a journal is the program's, but for a file that was renamed.
            asdict(each) | {"name": each.name if session_of(Path(each.name)) else "(a path)"}
            for each in states
        ],
        "not_read": why,
        "process_was_last_in": clean.text(str(marker or "")),
        "events_counted": dict(
            sorted(Counter(clean.text(event.name) for event in log.events).items())
        ),
    }


def _events(log: SessionLog, clean: Cleaner) -> Iterator[dict[str, Any]]:
    """Yield the events of the program, with seconds since the first one."""
    start = log.events[0].time if log.events else 0.0
    for event in log.events:
        if event.name in KEPT:
            yield _event(event, start, clean)


def _event(event: LoggedEvent, start: float, clean: Cleaner) -> dict[str, Any]:
    kept = {name: event.data[name] for name in KEPT[event.name] if name in event.data}
    return {
        "s": round(event.time - start, 6),
        "tick": int(event.tick) if math.isfinite(event.tick) else None,
        "part": event.part,
        "event": event.name,
        **{
            name: clean.name(value, NAMES[name])
            if name in NAMES and isinstance(value, str)
            else clean.data(value)
            for name, value in kept.items()
        },
    }


def _timing(log: SessionLog) -> dict[str, Any]:
    """Return how late ticks were, as a whole, in each minute, and the latest ones; in ms."""
    columns = {name: log.column("loop", name) for name in ("tick", "due", "woke", "wrote")}
    tick, due, woke, wrote = columns.values()
    if tick is None or due is None or woke is None or wrote is None or not len(due):
        return {"ticks": 0}
    late, writes = 1e3 * (woke - due), 1e3 * wrote
    minutes = ((due - due[0]) // MINUTE_S).astype(int)
    latest = np.argsort(-late, kind="stable")[:WORST]
    return {
        "ticks": len(due),
        "lateness_ms": _spread(late),
        "write_ms": _spread(writes),
        "minutes": [
            {"minute": int(one), "lateness_ms": _spread(late[minutes == one])}
            for one in np.unique(minutes)
        ],
        "latest": [
            {"tick": int(tick[at]), "lateness_ms": round(float(late[at]), 3)} for at in latest
        ],
    }


def _spread(values: np.ndarray[Any, np.dtype[np.float64]]) -> dict[str, float]:
    return {
        "median": round(float(np.median(values)), 3),
        "p99": round(float(np.quantile(values, 0.99)), 3),
        "most": round(float(np.max(values)), 3),
    }


def _stream(stream: RecordedStream, clean: Cleaner) -> dict[str, Any]:
    """Return how a stream of others came, without what it measured."""
    trips = stream.probes[:, 2]
    return {
        "name": clean.name(stream.header.name, "stream"),
        "type": clean.text(stream.header.type),
        "channels": len(stream.header.channels),
        "format": stream.header.format,
        "rate_hz": stream.header.rate_hz,
        "samples": len(stream.time_raw),
        "probes": len(trips),
        "round_trip_ms": _spread(1e3 * trips) if len(trips) else None,
        "parts": len(stream.starts),
        "notes_counted": Counter(clean.text(str(note.data.get("event"))) for note in stream.notes),
    }
