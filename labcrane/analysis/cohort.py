"""Cohort of a data folder: its participants, and who is included."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from labcrane.errors import ProtocolError, RecordingError, StorageError
from labcrane.files.yaml import parse_yaml
from labcrane.recording.data_folder import DataFolder, recorded
from labcrane.recording.participant_file.reader import Recording, SessionRecord
from labcrane.recording.participant_file.recover import backlog
from labcrane.recording.paths import nearby_file, participant_path

if TYPE_CHECKING:
    import pandas as pd


class Status(StrEnum):
    """Status of a participant's data, in the order of the rules: the first that applies."""

    ERASED = "erased"  # only an erasure record is left in the register; cannot be included
    EXCLUDED = "excluded"  # in the register, with a reason; cannot be included
    UNREADABLE = "unreadable"  # no participant file, or a damaged one; cannot be included
    FAULT = "fault"  # labcrane failed to compute its results; the recording is whole
    HALF_FINISHED = "half-finished"  # a session ended early, or is still to come
    SIMULATED = "simulated"
    PILOT = "pilot"
    COMPLETE = "complete"


Struck = tuple[Status, str]
"""Whether a participant was erased or excluded, and why."""

INCLUDABLE = (Status.SIMULATED, Status.PILOT, Status.HALF_FINISHED)
"""Statuses that are left out unless they are requested."""


@dataclass(frozen=True)
class Participant:
    """One participant of a study, with the recordings.

    Attributes
    ----------
    name
        Pseudonym with its stamps: ``P001``, ``P001-PILOT``.
    path
        The participant file.
    status
        Status of the data.
    why
        The reason for the status, in words.
    kind
        Simulated or pilot, whether half-finished or not; None for a person's data.
    study
        Name of the study that the file is of; empty where it is not known.
    measured
        The result of :func:`labcrane.analysis.measures.measures_of`, where it is there already.
    """

    name: str
    path: Path
    status: Status
    why: str
    kind: Status | None = field(default=None, kw_only=True)
    study: str = field(default="", kw_only=True)
    measured: "pd.DataFrame | None" = field(default=None, kw_only=True, repr=False, compare=False)

    @property
    def needs(self) -> frozenset[Status]:
        """Statuses that must all be requested to include the participant."""
        return frozenset({self.status, *([self.kind] if self.kind else [])})

    @property
    def recording(self) -> Recording:
        """The participant file; each access reads it again, so that memory does not fill up."""
        return Recording(self.path)

    @cached_property
    def context(self) -> dict[str, Any]:
        """Facts known when the first session started."""
        recording = self.recording
        return recording.session((self.usable or recording.sessions)[0]).context

    def sessions(self) -> Iterator[tuple[int, SessionRecord]]:
        """Yield number and record of each session, one in memory at a time."""
        recording = self.recording
        for number in self.usable:
            yield number, recording.session(number)

    def rows(
        self, of: Callable[[SessionRecord], Iterable[Mapping[str, Any]]]
    ) -> list[dict[str, Any]]:
        """Return the rows of a table of each session, with the participant and the session."""
        return [
            {"participant": self.name, "session": number, **row}
            for number, session in self.sessions()
            for row in of(session)
        ]

    @cached_property
    def usable(self) -> tuple[int, ...]:
        """Numbers of the sessions that contain data: one may have ended before its first tick."""
        recording = self.recording
        return tuple(
            number
            for number in recording.sessions
            if _hollow(number, recording.session(number)) is None
        )


@dataclass(frozen=True, slots=True)
class Cohort:
    """The participants of a data folder, included or left out.

    Attributes
    ----------
    included
        Those whose data are used.
    left_out
        The others; their ``status`` and ``why`` give the reason.
    """

    folder: Path
    included: tuple[Participant, ...]
    left_out: tuple[Participant, ...]

    def without(self, name: str, status: Status, why: str) -> "Cohort":
        """Return the cohort without a participant whose data could not be used.

        Raises
        ------
        RecordingError
            No other usable participant is left.
        """
        gone = [
            replace(person, status=status, why=why)
            for person in self.included
            if person.name == name
        ]
        kept = tuple(person for person in self.included if person.name != name)
        left_out = tuple(sorted((*self.left_out, *gone), key=lambda person: person.name))
        if not kept:
            raise RecordingError(_nobody(self.folder, left_out))
        return Cohort(self.folder, kept, left_out)

    @property
    def unreadable(self) -> tuple[Participant, ...]:
        """Participants left out because their recordings cannot be used."""
        bad = {Status.UNREADABLE, Status.FAULT}
        return tuple(person for person in self.left_out if person.status in bad)

    def listing(self) -> "pd.DataFrame":
        """Return all participants with status and reason, to be shown with every average."""
        import pandas as pd

        rows = [
            {"participant": person.name, "status": str(person.status), "included": word}
            | {"why": person.why}
            for people, word in ((self.included, "yes"), (self.left_out, "no"))
            for person in people
        ]
        columns = ["participant", "status", "included", "why"]
        table = pd.DataFrame(rows, columns=columns)
        return table.sort_values("participant", ignore_index=True)


def find_cohort(
    folder: Path,
    include: Iterable[str] = (),
    struck: Mapping[str, Struck] | None = None,
    unregistered: Mapping[str, str] | None = None,
) -> Cohort:
    """Find every participant below ``folder``.

    Complete participants are included. Others only when their status is named in ``include``; a
    half-finished pilot or simulation needs both of its words.

    Parameters
    ----------
    include
        Statuses to be used as well: simulated, pilot, half-finished.
    struck
        Participants whom the register excludes, and why, by name: they are listed, never used.
    unregistered
        What is missing of participants who are not in the register, by name: it is added to why
        they are used or left out.

    Raises
    ------
    ProtocolError
        ``include`` names something else.
    RecordingError
        There is no such folder, it has no usable participant, or participants of two studies.
    """
    wanted = {Status.COMPLETE, *(_includable(word) for word in include)}
    people = everyone(folder, struck, unregistered)
    included = tuple(person for person in people if person.needs <= wanted)
    left_out = tuple(person for person in people if not person.needs <= wanted)
    if not included:
        raise RecordingError(_nobody(folder, left_out))
    if len(studies := {person.study: person.name for person in included}) > 1:
        found = " and ".join(f"{study!r} (as of {name})" for study, name in studies.items())
        raise RecordingError(
            f"{folder} holds recordings of {len(studies)} studies, {found}, which are not one "
            "cohort: give each study a data folder of its own"
        )
    return Cohort(folder, included, left_out)


def everyone(
    folder: Path,
    struck: Mapping[str, Struck] | None = None,
    unregistered: Mapping[str, str] | None = None,
) -> list[Participant]:
    """Return all who have data below ``folder`` or were struck, sorted by name.

    Parameters
    ----------
    struck, unregistered
        As in :func:`find_cohort`.

    Raises
    ------
    RecordingError
        There is no such folder.
    """
    if not folder.is_dir():
        found = nearby_file(folder)
        where = f", {found.parent.parent}, which holds {found}" if found else ""
        raise RecordingError(
            f"there is no data folder {folder}; give the study's data folder{where}"
        )
    folders = recorded(folder)
    struck = struck or {}
    gone = [name for name in struck if not any(entry.name == name for entry in folders)]
    people = [_look(entry, struck.get(entry.name)) for entry in folders]
    people = [
        replace(person, why=f"{person.why}; {unregistered[person.name]}")
        if unregistered and person.name in unregistered
        else person
        for person in people
    ]
    people += [Participant(name, participant_path(folder / name), *struck[name]) for name in gone]
    return sorted(people, key=lambda person: person.name)


def _includable(word: str) -> Status:
    possible = {str(status): status for status in INCLUDABLE}
    if word not in possible:
        raise ProtocolError(
            f"{word!r} cannot be included; possible: {', '.join(possible)} "
            "(complete participants always are, erased, excluded and unreadable ones never)"
        )
    return possible[word]


def _nobody(folder: Path, left_out: Sequence[Participant]) -> str:
    if not left_out and (path := participant_path(folder)).exists():
        return (
            f"{folder} is not a study's data folder but contains one recording, {path.name}; give "
            "the folder above it, or read what was recorded without a study with "
            "labcrane.open_recording, or its ses-*_streams.xdf with any reader of XDF"
        )
    if not left_out:
        return f"there is no participant in {folder}; give the folder that holds P001/P001.h5"
    counts = {str(s): sum(p.status is s for p in left_out) for s in Status}
    found = ", ".join(f"{count} {status}" for status, count in counts.items() if count)
    remedies = [f"{p.name}: {p.why}" for p in left_out if p.status is Status.UNREADABLE]
    if counts[str(Status.HALF_FINISHED)]:
        remedies.append("labcrane resume --participant NAME continues an interrupted session")
    needed = {status for person in left_out for status in person.needs}
    asked = [f"--include {status}" for status in INCLUDABLE if status in needed]
    if asked:
        remedies.append(f"to use them as well: {' '.join(asked)}")
    return "; ".join([f"no usable participant in {folder}: {found}", *remedies])


def _look(folder: Path, struck: Struck | None) -> Participant:
    path = participant_path(folder)
    if struck is not None:
        return Participant(folder.name, path, *struck)
    status, kind, study = Status.UNREADABLE, None, ""
    try:
        if not (why := _unusable(folder, path)):
            recording = Recording(path)
            sessions = {number: recording.session(number) for number in recording.sessions}
            status, why, kind = _judge(sessions, folder.name)
            contexts = (session.context for session in sessions.values())
            study = next((str(each["study"]) for each in contexts if "study" in each), "")
    except StorageError:  # nothing is known of the file
        raise
    except (RecordingError, ProtocolError) as error:  # of the file, of the protocol in it
        why = str(error)
    return Participant(folder.name, path, status, why, kind=kind, study=study)


def _unusable(folder: Path, path: Path) -> str:
    """Return why nothing of a participant can be used; empty if something can."""
    if not path.exists():
        options = DataFolder.options(folder.name)
        if any(folder.glob("ses-*_run*.xdf")):
            return (
                f"its session is still running, or was killed: labcrane resume {options} continues "
                f"it, and labcrane recover {folder} builds the participant file from what was "
                "recorded"
            )
        return (
            "its session did not start: only external streams are recorded; labcrane run "
            f"{options} begins it"
        )
    if behind := backlog(path):
        return "; ".join(behind.values())
    recording = Recording(path)
    sessions = {number: recording.session(number) for number in recording.sessions}
    if not sessions:
        return "holds no session"
    hollow = [_hollow(number, session) for number, session in sessions.items()]
    if None not in hollow:
        return str(hollow[0])
    if recording.participant != folder.name:
        return (
            f"says that it is of {recording.participant}: a copy, or in the wrong folder; "
            f"remove it, or name its folder {recording.participant}"
        )
    return _stranger(folder.name, {number: each.context for number, each in sessions.items()})


def _stranger(name: str, contexts: Mapping[int, Mapping[str, Any]]) -> str:
    """Return which session is of another person or study, as its own metadata says; else empty."""
    for number, context in contexts.items():
        if (other := context.get("participant", name)) != name:
            return f"session {number} says that it is of {other}: take it out"
    studies = {str(each["study"]): at for at, each in contexts.items() if "study" in each}
    if len(studies) > 1:
        found = ", ".join(f"session {number} of {study!r}" for study, number in studies.items())
        return f"its sessions are of {len(studies)} studies, {found}: take out what is not of yours"
    return ""


def _hollow(number: int, session: SessionRecord) -> str | None:
    """Return why a session contains no usable data; None if it does."""
    if not session.context:
        return f"session {number} has no metadata: it did not start, or was killed at its start"
    if "state" not in session.streams or not len(session.streams["state"].time):
        return f"session {number} contains no frames: it ended before its first tick"
    return None


def kinds_of(participants: Iterable[Participant]) -> str:
    """Return ``SIMULATED and PILOT``, as far as there are any; empty if all are real recordings."""
    found = {participant.kind for participant in participants}
    named = [str(kind).upper() for kind in (Status.SIMULATED, Status.PILOT) if kind in found]
    return " and ".join(named)


def _judge(sessions: Mapping[int, SessionRecord], name: str) -> tuple[Status, str, Status | None]:
    """Return the status, the reason for it, and the kind of the sessions."""
    kind, stamp = _kind(sessions)
    why = _incomplete(sessions, name)
    if why is not None:
        said = f"{why}; {stamp}" if stamp else why
        return Status.HALF_FINISHED, said, kind
    if kind is not None:
        return kind, stamp, kind
    return Status.COMPLETE, f"{_progress(sessions)} to their end", None


def _kind(sessions: Mapping[int, SessionRecord]) -> tuple[Status | None, str]:
    """Return whether sessions are simulated or of a pilot, and which, in words."""
    for kind, word in ((Status.SIMULATED, "simulated"), (Status.PILOT, "pilot")):
        stamped = [number for number, each in sessions.items() if each.attrs.get(word) == "yes"]
        if stamped:
            return kind, f"session {', '.join(map(str, stamped))} is stamped {word}"
    return None, ""


def _incomplete(sessions: Mapping[int, SessionRecord], name: str) -> str | None:
    """Return what is missing of a protocol's sessions, or None if all ran to their end."""
    for number, session in sessions.items():
        if (hollow := _hollow(number, session)) is not None:
            return f"{hollow}; the other sessions can be used"
        if (why := unfinished(session)) is not None:
            which = f" --session {number}" if number > 1 else ""
            again = f"labcrane resume {DataFolder.options(name)}{which}"
            return f"session {number} {why}; to continue it, run {again}"
    _, last = max(sessions.items())
    return _progress(sessions) if len(sessions) < _planned(last.protocol) else None


def _progress(sessions: Mapping[int, SessionRecord]) -> str:
    _, last = max(sessions.items())
    return f"{len(sessions)} of {_planned(last.protocol)} sessions recorded"


def unfinished(session: SessionRecord) -> str | None:
    """Return how a session ended before its end, or None when it did not."""
    events = session.events
    marks = events[events["name"].isin(["session.start", "session.end", "session.failed"])]
    last = marks.iloc[-1] if len(marks) else None
    if last is None or last["name"] == "session.start":
        return "has no end: the program was killed"
    if last["name"] == "session.failed":
        return f"failed: {last['data'].get('why')}"
    reason = str(last["data"].get("reason"))
    if reason == "complete":
        return None
    return f"ended {reason}" if reason in {"by order", "incomplete"} else f"ended: {reason}"


def _planned(protocol: str) -> int:
    """Return how many sessions a protocol has."""
    content = parse_yaml(protocol, "the recorded protocol", recorded=True)
    sessions = content.get("sessions") if isinstance(content, dict) else None
    if not isinstance(sessions, list):
        raise RecordingError("the recorded protocol has no sessions: the file was changed")
    return len(sessions)
