"""Problem report: the files of an archive for a bug report, with nothing of people in them.

What goes in is named here, event by event and field by field; everything else stays out. Texts that
go in are cleaned: pseudonyms, users, computers, folders and addresses are replaced.
"""

import getpass
import json
import math
import os
import platform
import re
import socket
import traceback
import zipfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import numpy as np

from labcrane.doctor.report import Diagnosis
from labcrane.doctor.versions import versions
from labcrane.errors import RecordingError
from labcrane.files.atomic import replacing
from labcrane.participants.folders import Places
from labcrane.participants.mentions import LETTER, spellings
from labcrane.participants.register import read
from labcrane.recording.crash_marker import crash_marker_path, read_crash_marker
from labcrane.recording.data_folder import DataFolder
from labcrane.recording.foreign_streams import RecordedStream, read_streams
from labcrane.recording.journal_reader import JournalState, LoggedEvent, SessionLog, read_journal
from labcrane.recording.paths import journal_path, parts, session_of

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
participant-1 and so on. Users, computers, folders and addresses are replaced.
"""

_MAIL = re.compile(r"[^\s@]{1,64}@[^\s@]+\.\w\w\S*")
_URL = re.compile(r"\b[a-z][a-z0-9+.-]*://[^\s\"'<>]+", re.IGNORECASE)
_PART = r"[^/\\\n\"'<>|:;,()\[\]{}]+"  # a folder may have spaces, where a slash follows
_LAST = r"[^\s/\\\"'<>|:;,()\[\]{}]*"
_PATH = re.compile(
    r"/dev/\w+(?![\w/])|"
    rf"(?<![\w.)\]°/\\…])(?:~[\w.-]*|[A-Za-z]:|\\(?=\\))?[/\\]+(?=[^\s/\\])(?:{_PART}[/\\]+)*{_LAST}"
)
_SLASHES = re.compile(r"[/\\]+")
_HOME = re.compile(r"(?:[A-Za-z]:)?[/\\]+(?:home|Users)[/\\]+[^/\\\s\"']+", re.IGNORECASE)
_DEVICE = re.compile(r"/dev/\w+")
_ADDRESS = re.compile(
    r"(?<![\w.-])\d{1,3}(?:\.\d{1,3}){3}(?![\w-]|\.\d)"  # Linux-5.15.167.4-generic is none
    r"|\b(?:[0-9a-f]{2}-){5}[0-9a-f]{2}\b"
    r"|(?<![\w:])(?:[0-9a-f]{1,4}:){3,}[0-9a-f:]*"
    r"|(?<![\w:])(?:[0-9a-f]{1,4})?::[0-9a-f][0-9a-f:]*",
    re.IGNORECASE,
)
_ORDINARY = frozenset(
    [
        "data", "desktop", "documents", "home", "lab", "labcrane", "media", "mnt", "opt", "private",
        "protocols", "studies", "study", "tmp", "users", "usr", "var", "work",
    ]
)  # fmt: skip
"""Names of folders, users and computers that identify no person."""

_SHORT = 4
"""Users and computers with fewer letters are replaced as whole words: others hold them by chance.

So are folders and pseudonyms."""


class Cleaner:
    """Replaces in texts what could lead to people or to their computers.

    Parameters
    ----------
    people
        Pseudonyms; each becomes ``participant-1`` and so on, in the order of their names.
    computers
        Names of computers beside this one's.
    folders
        Folders whose names are replaced wherever they are: of the study and of the data.
    """

    def __init__(
        self, people: Iterable[str], computers: Iterable[str], folders: Iterable[Path]
    ) -> None:
        known = [*folders, Path.home(), Path.cwd()]
        places = {str(each) for folder in known for each in (folder.absolute(), folder.resolve())}
        self._places = _any_of(each for each in places if len(Path(each).parts) > 1)
        named = dict.fromkeys(_of_hosts(computers), "computer") | dict.fromkeys(_users(), "user")
        names = dict.fromkeys(_parts(places), "folder") | named
        self._names = {
            name.lower(): word
            for name, word in names.items()
            if name.lower() not in {"", *_ORDINARY}
        }
        self._people = {
            spelled.lower(): f"participant-{number}"
            for number, person in enumerate(sorted(set(people)), start=1)
            for spelled in spellings(person)
            if spelled
        }
        anywhere = {name.lower() for name in named if len(name) >= _SHORT} & set(self._names)
        self._anywhere = _any_of(anywhere)
        self._words = _any_of(set(self._names) - anywhere, whole=True)
        self._called = _any_of(self._people, whole=True)

    def text(self, text: str) -> str:
        """Return a text without people, users, computers, folders and addresses."""
        text = _URL.sub("(an address)", _MAIL.sub("(an e-mail address)", text))
        text = self._places.sub("/…", text)  # their names may have spaces
        text = _HOME.sub("…/user", _PATH.sub(_named_only, text))
        text = _ADDRESS.sub("(an address)", text)
        text = self._called.sub(lambda found: self._people[found[0].lower()], text)
        for pattern in (self._anywhere, self._words):
            text = pattern.sub(lambda found: self._names[found[0].lower()], text)
        return text

    def data(self, value: Any) -> Any:
        """Return plain data with every text in it cleaned; names of fields too."""
        if isinstance(value, str):
            return self.text(value)
        if isinstance(value, Mapping):
            return {self.text(str(key)): self.data(each) for key, each in value.items()}
        if isinstance(value, list | tuple):
            return [self.data(each) for each in value]
        return value


def _any_of(words: Iterable[str], *, whole: bool = False) -> re.Pattern[str]:
    """Return what finds any of some words, the longest first."""
    listed = "|".join(re.escape(word) for word in sorted(words, key=len, reverse=True))
    if not listed:
        return re.compile(r"(?!)")
    found = rf"(?<!{LETTER})(?:{listed})(?!{LETTER})" if whole else listed
    return re.compile(found, re.IGNORECASE)


def _named_only(found: re.Match[str]) -> str:
    """Return a path as its last name; a device as it is, and a user's folder without the user."""
    if _DEVICE.fullmatch(found[0]):
        return found[0]
    path = found[0].rstrip("/\\")
    if _HOME.fullmatch(path):
        return "…/user"
    last = _SLASHES.split(path)[-1]
    return "…" if last == "…" else f"…/{last}"


def _parts(places: Iterable[str]) -> list[str]:
    """Return the names of folders, and of those that they are in."""
    return [part for place in places for part in Path(place).parts[1:]]


def _users() -> Iterator[str]:
    yield from (os.environ.get(name, "") for name in ("USER", "USERNAME", "LOGNAME"))
    yield Path.home().name
    with suppress(OSError, KeyError, ImportError):  # a process without an account
        yield getpass.getuser()


def _of_hosts(others: Iterable[str]) -> Iterator[str]:
    """Yield names of computers, each also without its domain."""
    for name in (
        platform.node(),
        socket.gethostname(),
        os.environ.get("COMPUTERNAME", ""),
        *others,
    ):
        yield name
        yield name.partition(".")[0]


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


def people_of(folder: Path) -> set[str]:
    """Return all pseudonyms that a data folder, or the one that a part of it is in, knows.

    Raises
    ------
    RecordingError
        Its register cannot be read, so the pseudonyms to be replaced are unknown.
    """
    names = set()
    for root in (folder, folder.absolute().parent):
        if (places := Places(root)).register.is_file():
            register = read(places)
            names |= set(register.names())
            names |= {each for entry in register.participants.values() for each in entry.formerly}
    journals = [*folder.rglob("ses-*.xdf"), *folder.absolute().parent.glob("*/ses-*.xdf")]
    return names | {DataFolder.pseudonym(path.parent.name) for path in journals}


def compose(
    found: Diagnosis, trouble: Sequence[str], session: FoundSession | None, folders: Sequence[Path]
) -> dict[str, str]:
    """Return the files of the archive by name.

    Parameters
    ----------
    found
        What the doctor found.
    trouble
        What kept the study from being read, in words; empty for nothing.
    session
        Whose journals go in; None for none.
    folders
        The data folder first, then the study's.
    """
    people = people_of(folders[0]) if folders[0].is_dir() else set()
    log, streams, states, unread = _read(session) if session else (SessionLog(), [], [], [])
    if log.context:
        people.add(DataFolder.pseudonym(str(log.context.get("participant", ""))))
    clean = Cleaner(people - {""}, [found.computer, *_computers(log, streams)], folders)
    installed = sorted({f"{each.name}-{each.version}" for each in distributions()}, key=str.lower)
    files = {
        "README.txt": README,
        "versions.txt": clean.text("\n".join([*versions(), ""])),
        "installed.txt": clean.text("\n".join([*installed, ""])),
        "doctor.json": _json(clean.data(_findings(found, trouble))),
    }
    if session is None:
        return files
    return files | {
        "session/about.json": _json(clean.data(_about(session, log, states, unread))),
        "session/timing.json": _json(_timing(log)),
        "session/events.jsonl": "".join(
            f"{json.dumps(clean.data(each), ensure_ascii=False)}\n" for each in _events(log)
        ),
        "session/streams.json": _json(clean.data([_stream(each) for each in streams])),
    }


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


def _findings(found: Diagnosis, trouble: Sequence[str]) -> dict[str, Any]:
    """Return what the doctor found, without what names other computers on the network."""
    data = found.as_data()
    del data["computer"]
    for check in data["checks"]:
        foreign = check["area"].startswith("lsl") and check["text"].startswith("stream ")
        if foreign and not check["text"].endswith("is not announced"):
            check["text"] = "(about a stream of another computer; left out)"
            check["advice"] = ""
    return {"study_not_read": list(trouble), **data}


def _about(
    session: FoundSession, log: SessionLog, states: Sequence[JournalState], unread: Sequence[str]
) -> dict[str, Any]:
    """Return what a session was made of, and how its journals were found."""
    context = log.context
    marker = read_crash_marker(
        crash_marker_path(journal_path(session.folder, session.number, "run"))
    )
    components = context.get("components", {})
    at_start = ((context.get("doctor") or {}).get("at_start") or {}).get("checks", [])
    return {
        "session": session.number,
        **{name: context[name] for name in ABOUT if name in context},
        "components": {
            part: {name: each.get(name) for name in ("use", "plugin")}
            for part, each in components.items()
        },
        "doctor_at_start": at_start,
        "journals": [asdict(each) for each in states],
        "not_read": list(unread),
        "process_was_last_in": str(marker or ""),
        "events_counted": Counter(event.name for event in log.events),
    }


def _events(log: SessionLog) -> Iterator[dict[str, Any]]:
    """Yield the events of the program, with seconds since the first one."""
    start = log.events[0].time if log.events else 0.0
    for event in log.events:
        if event.name in KEPT:
            yield _event(event, start)


def _event(event: LoggedEvent, start: float) -> dict[str, Any]:
    kept = {name: event.data[name] for name in KEPT[event.name] if name in event.data}
    return {
        "s": round(event.time - start, 6),
        "tick": int(event.tick) if math.isfinite(event.tick) else None,
        "part": event.part,
        "event": event.name,
        **kept,
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


def _stream(stream: RecordedStream) -> dict[str, Any]:
    """Return how a stream of others came, without what it measured."""
    trips = stream.probes[:, 2]
    return {
        "name": stream.header.name,
        "type": stream.header.type,
        "channels": len(stream.header.channels),
        "format": stream.header.format,
        "rate_hz": stream.header.rate_hz,
        "samples": len(stream.time_raw),
        "probes": len(trips),
        "round_trip_ms": _spread(1e3 * trips) if len(trips) else None,
        "parts": len(stream.starts),
        "notes_counted": Counter(str(note.data.get("event")) for note in stream.notes),
    }
