"""Overview of a study: people, their visits, what is due, and what went otherwise than planned."""

import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from labcrane.analysis.cohort import Participant, Status, everyone, unfinished
from labcrane.analysis.quality import loop_quality, sync_quality
from labcrane.analysis.unusable import Unusable
from labcrane.approval.lock import lock_path, read_lock
from labcrane.core.findings import Verdict
from labcrane.errors import ProtocolError
from labcrane.files.study_folder import data_of, protocol_of
from labcrane.files.yaml import parse_yaml
from labcrane.participants.deviations import all_deviations
from labcrane.participants.folders import Places
from labcrane.participants.register import Deviation, Entry, Register, read, struck, unregistered
from labcrane.participants.session_windows import days_of
from labcrane.recording.data_folder import DataFolder
from labcrane.recording.participant_file.reader import SessionRecord
from labcrane.streams.sync.report.limits import LATE

if TYPE_CHECKING:
    import pandas as pd

LEVELS = {Verdict.PASS: "ok", Verdict.WARN: "warn", Verdict.FAIL: "bad"}
WORST = ("ok", "warn", "bad")


@dataclass(frozen=True, slots=True)
class PlannedSession:
    """One session of the protocol.

    Attributes
    ----------
    after_days
        How many days after the session before it may be, first and last; None for any time.
    """

    number: int
    name: str
    after_days: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True)
class Sat:
    """One recorded session, and how good it is.

    Attributes
    ----------
    level
        ``"ok"``, ``"warn"`` or ``"bad"``: the worst of loop, clocks and end.
    said
        The same in words, a line each.
    """

    number: int
    day: str
    level: str
    said: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Due:
    """A participant's next session.

    Attributes
    ----------
    first, last
        From which day to which; None where no window is planned.
    state
        ``"due"``, ``"later"`` or ``"overdue"``.
    """

    session: int
    name: str
    state: str
    first: date | None = None
    last: date | None = None

    @property
    def said(self) -> str:
        """Return it in words."""
        window = "" if self.first is None else f", {self.first} to {self.last}"
        word = {"due": "due", "later": "not before its window", "overdue": "overdue"}[self.state]
        return f"session {self.session} ({self.name}) {word}{window}"


@dataclass(frozen=True, slots=True)
class Person:
    """One participant, with what was recorded of them.

    Attributes
    ----------
    name
        Pseudonym with its stamps.
    consent, consent_level
        In words; ``"bad"`` if the participant was recorded without the approved text.
    due
        The next session; None when there is none.
    bytes
        On the disk.
    """

    name: str
    status: str
    why: str
    group: str = ""
    consent: str = ""
    consent_level: str = "ok"
    sat: tuple[Sat, ...] = ()
    due: Due | None = None
    deviations: tuple[Deviation, ...] = ()
    notes: tuple[str, ...] = ()
    bytes: int = 0

    @property
    def real(self) -> bool:
        """Whether these are a participant's data, not those of a pilot or a simulation."""
        kinds = {Status.SIMULATED, Status.PILOT}
        return DataFolder.pseudonym(self.name) == self.name and self.status not in kinds


@dataclass(frozen=True, slots=True)
class Overview:
    """Everything that the page shows.

    Attributes
    ----------
    groups
        How many hold a slot in each group, and how many of them are complete.
    balanced
        Whether the groups differ by one at most.
    approval
        Of the protocol next to the data, in words.
    used, free
        Bytes of the data folder, and left on its disk.
    lasts
        For how many more sessions like these the disk is large enough; None before the first.
    report
        The newest report's folder; None where there is none.
    """

    study: str
    folder: Path
    planned: tuple[PlannedSession, ...]
    people: tuple[Person, ...]
    groups: Mapping[str, tuple[int, int]]
    approval: str
    used: int
    free: int
    lasts: int | None
    report: Path | None
    erased: tuple[str, ...] = ()

    @property
    def balanced(self) -> bool:
        """Whether no group has more than one person more than another."""
        sizes = [size for size, _ in self.groups.values()]
        return not sizes or max(sizes) - min(sizes) <= 1

    @property
    def due(self) -> list[tuple[Person, Due]]:
        """Who is due, those who are late first."""
        order = {"overdue": 0, "due": 1, "later": 2}
        found = [(person, person.due) for person in self.people if person.due is not None]
        return sorted(found, key=lambda each: (order[each[1].state], each[0].name))


@dataclass
class Reader:
    """Reads a study's folder, and again only what has changed in it.

    Parameters
    ----------
    data
        The study's data folder.
    protocol
        The protocol; None for the newest that was recorded.
    """

    data: Path
    protocol: Path | None = None
    _kept: dict[Path, tuple[tuple[int, int], tuple[Sat, ...]]] = field(default_factory=dict)

    @classmethod
    def of(cls, study: Path) -> "Reader":
        """Return the reader of a study: of its folder, its protocol or its data folder."""
        data = data_of(study)
        try:
            return cls(data, protocol_of(study))
        except ProtocolError:  # data alone
            return cls(data)

    def overview(self, today: date) -> Overview:
        """Return the study as it stands.

        Raises
        ------
        RecordingError
            There is no such folder, or its register is damaged.
        """
        places = Places(self.data)
        register = read(places)
        recorded = (
            everyone(self.data, struck(places), unregistered(places)) if self.data.is_dir() else []
        )
        text = self._text(recorded)
        planned = _planned(text)
        version = self._consent_version()
        deviations: dict[str, list[Deviation]] = {}
        for name, each in all_deviations(places):
            deviations.setdefault(name, []).append(each)
        by_name = {person.name: person for person in recorded}
        people = [
            self._person(name, by_name.get(name), register.participants.get(name), version)
            for name in sorted({*by_name, *register.participants})
            if by_name.get(name) is None or by_name[name].status is not Status.ERASED
        ]
        people = [
            replace(
                person,
                due=_due(planned, person, register.participants.get(person.name), today),
                deviations=tuple(deviations.get(person.name, ())),
            )
            for person in people
        ]
        used = sum(path.stat().st_size for path in places.files())
        free = shutil.disk_usage(self.data if self.data.is_dir() else self.data.parent).free
        sessions = sum(len(person.sat) for person in people)
        return Overview(
            study=str(text.get("title") or text.get("study") or register.study or self.data.name),
            folder=self.data,
            planned=planned,
            people=tuple(people),
            groups=_groups(text, register, people),
            approval=self._approval(today),
            used=used,
            free=free,
            lasts=int(free / (used / sessions)) if used and sessions else None,
            report=newest_report(register),
            erased=tuple(f"{s.participant} on {s.date}: {s.reason}" for s in register.tombstones),
        )

    def _text(self, recorded: Sequence[Participant]) -> dict[str, Any]:
        """Return the protocol as it is written; empty if it is unknown."""
        if self.protocol is not None:
            content = parse_yaml(self.protocol.read_text(encoding="utf-8"), str(self.protocol))
            return dict(content) if isinstance(content, dict) else {}
        usable = [one for one in recorded if one.status not in {Status.ERASED, Status.UNREADABLE}]
        usable = [one for one in usable if one.path.is_file()]
        for one in sorted(usable, key=lambda one: one.path.stat().st_mtime, reverse=True):
            recording = one.recording
            protocol = recording.session(recording.sessions[-1]).protocol
            content = parse_yaml(protocol, "the recorded protocol", recorded=True)
            if isinstance(content, dict):
                return dict(content)
        return {}

    def _person(
        self, name: str, own: Participant | None, entry: Entry | None, version: str | None
    ) -> Person:
        sat = self._sat(own) if own is not None else ()
        status, why = (
            (str(own.status), own.why) if own is not None else ("enrolled", "has not been yet")
        )
        folder = self.data / name
        held = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        if entry is None:
            stamped = DataFolder.pseudonym(name) != name
            level = "ok" if version is None or stamped else "bad"
            said = "" if level == "ok" else "none in the register"
            return Person(name, status, why, consent=said, consent_level=level, sat=sat, bytes=held)
        days = {sitting.session: sitting.date for sitting in entry.sessions}
        sat = tuple(replace(each, day=days.get(each.number, each.day)) for each in sat)
        given = entry.consent[-1] if entry.consent else None
        said = f"{given.version}, {given.date}" if given else "none"
        level = "ok" if given or not sat else "bad"
        if given and version is not None and given.version != version:
            said, level = f"{said}: for an earlier text than {version}", "warn"
        return Person(
            name, status, why, entry.group, said, level, sat, notes=tuple(entry.notes), bytes=held
        )

    def _sat(self, own: Participant) -> tuple[Sat, ...]:
        """Return the quality of every session of a file, read again only if it has changed."""
        try:
            about = own.path.stat()
        except FileNotFoundError:
            return ()
        stamp = about.st_mtime_ns, about.st_size
        if own.path not in self._kept or self._kept[own.path][0] != stamp:
            self._kept[own.path] = stamp, _sessions(own)
        return self._kept[own.path][1]

    def _consent_version(self) -> str | None:
        """Return the version of the approved consent text; None where nothing is approved."""
        if self.protocol is None or not lock_path(self.protocol).is_file():
            return None
        return read_lock(self.protocol).consent_version

    def _approval(self, today: date) -> str:
        if self.protocol is None:
            return "no protocol in the folder of the data: the plan is from the latest recording"
        if not lock_path(self.protocol).is_file():
            return f"{self.protocol.name} has no approval"
        lock = read_lock(self.protocol)
        try:
            lock.check_date(today)
        except ProtocolError as error:
            return str(error)
        about = lock.approval
        return f"approved by {about['board']}, {about['reference']}, until {about['valid_until']}"


def _planned(text: Mapping[str, Any]) -> tuple[PlannedSession, ...]:
    sessions = text.get("sessions") or ()
    return tuple(
        PlannedSession(number, str(each.get("name", number)), _window(each.get("after_days")))
        for number, each in enumerate(sessions, 1)
        if isinstance(each, dict)
    )


def _window(days: Any) -> tuple[int, int] | None:
    return (int(days[0]), int(days[1])) if days else None


def _sessions(own: Participant) -> tuple[Sat, ...]:
    """Return every session of a file and how good it is; a wreck says that it is one."""
    if own.status is Status.UNREADABLE:
        return (Sat(0, "", "bad", (own.why,)),)
    try:
        loops, syncs = loop_quality(own), sync_quality(own)
        return tuple(_quality(number, record, loops, syncs) for number, record in own.sessions())
    except Exception as error:  # noqa: BLE001 - one recording never stops the page
        return (Sat(0, "", "bad", (Unusable.of(error).why,)),)


def _quality(
    number: int, record: SessionRecord, loops: "pd.DataFrame", syncs: "pd.DataFrame"
) -> Sat:
    loop = loops[loops["session"] == number].iloc[0]
    late, ticks, verdict = int(loop["late_ticks"]), int(loop["ticks"]), str(loop["sync_verdict"])
    levels = [LEVELS[LATE.judge(late / ticks)]]
    said = [f"{ticks:,} ticks, none late"]
    if late:
        worst = loop["lateness_worst_ms"]
        said = [f"{late:,} of {ticks:,} ticks late ({late / ticks:.2%}), the worst {worst:.0f} ms"]
    if verdict in set(Verdict):
        levels.append(LEVELS[Verdict(verdict)])
    streams = syncs[syncs["session"] == number] if len(syncs) else syncs
    if len(streams):
        said.append(f"timestamps of {len(streams)} external streams: {verdict or 'not judged'}")
        if lost := streams[streams["corrected"] == "no"]["stream"].tolist():
            levels.append("bad")
            said.append(f"not on the session's clock: {', '.join(map(str, lost))}")
    outcomes = Counter(map(str, record.trials["outcome"])) if len(record.trials) else Counter()
    counted = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common())
    said.append(f"trials: {counted or 'none'}")
    if (why := unfinished(record)) is not None:
        levels.append("warn")
        said.append(why)
    # A clock that jumps begins in 1970.
    known = record.attrs.get("clock") != "manual"
    day = str(record.attrs.get("started", ""))[:10] if known else ""
    return Sat(number, day, max(levels, key=WORST.index), tuple(said))


def _due(
    planned: Sequence[PlannedSession], person: Person, entry: Entry | None, today: date
) -> Due | None:
    """Return a person's next session; None if all are done, or if excluded or simulated."""
    if not person.real or person.status == Status.EXCLUDED:
        return None
    begun = {each.number: each.day for each in person.sat if each.number}
    if entry is not None:
        begun |= {sitting.session: sitting.date for sitting in entry.sessions}
    coming = next((each for each in planned if each.number not in begun), None)
    if coming is None:
        return None
    before = begun.get(coming.number - 1, "")
    days = before and days_of(coming.number, coming.after_days, date.fromisoformat(before), entry)
    if not days:
        return Due(coming.number, coming.name, "due")
    first, last = days
    state = "later" if today < first else "due" if today <= last else "overdue"
    return Due(coming.number, coming.name, state, first, last)


def _groups(
    text: Mapping[str, Any], register: Register, people: Sequence[Person]
) -> dict[str, tuple[int, int]]:
    design = text.get("design")
    named = design.get("groups") if isinstance(design, dict) else None
    groups = [str(name) for name in named or ()]
    complete = {person.name for person in people if person.status == Status.COMPLETE}
    return {
        group: (
            sum(one.group == group and one.holds_slot for one in register.participants.values()),
            sum(
                one.group == group and one.holds_slot and name in complete
                for name, one in register.participants.items()
            ),
        )
        for group in groups
    }


def newest_report(register: Register) -> Path | None:
    """Return the path of the latest report, if it still exists."""
    made = [Path(one.folder) for one in register.exports if one.exporter == "report"]
    return next((folder for folder in reversed(made) if (folder / "report.html").is_file()), None)
