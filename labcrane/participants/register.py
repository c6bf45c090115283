"""The register: who takes part, without names.

One JSON file, always replaced whole while a lock is held, so that two processes can write at once
and a kill leaves it as it was before or after a change.
"""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from labcrane.errors import ProtocolError, RecordingError
from labcrane.files.atomic import write_text
from labcrane.files.lock import exclusive
from labcrane.participants.folders import Places
from labcrane.recording.data_folder import DataFolder, recorded

if TYPE_CHECKING:
    from labcrane.analysis.cohort import Struck


class Record(BaseModel):
    """A part of the register."""

    model_config = ConfigDict(extra="forbid", validate_assignment=True)


class Consent(Record):
    """One confirmation that a person has consented."""

    version: str
    """Which text: the hash in the lock, shortened."""
    file: str
    date: str
    by: Literal["examiner", "participant"]


class Deviation(Record):
    """Something that did not go as the protocol says."""

    what: str
    session: int = 0
    """0 where it belongs to no session."""
    trial: int = 0
    """0 where it belongs to no trial."""
    detail: str = ""
    date: str = ""


class Sitting(Record):
    """One session that was begun."""

    session: int
    date: str
    """Day on which it began, ISO."""
    lock: str
    """Seal of the lock under which it was run."""
    amendment: int
    """How many amendments the study had then."""
    consent: str
    """Version of the consent text."""
    deviations: list[Deviation] | None = None
    """None until they have been taken from the recording."""


class Exclusion(Record):
    """Why a participant's data are not used, or why the participant left."""

    date: str
    reason: str


class Entry(Record):
    """One participant.

    A participant who was excluded or has dropped out leaves the slot to another one; ``slot``
    remains, since it says what the participant's sessions were.
    """

    slot: int = Field(ge=1)
    group: str = ""
    seed: int
    enrolled: str
    holds_slot: bool = True
    consent: list[Consent] = Field(default_factory=list)
    sessions: list[Sitting] = Field(default_factory=list)
    exclusion: Exclusion | None = None
    waivers: dict[str, str] = Field(default_factory=dict)
    """Sessions that may be run outside their window, and why."""
    notes: list[str] = Field(default_factory=list)
    deviations: list[Deviation] = Field(default_factory=list)
    formerly: list[str] = Field(default_factory=list)
    """Pseudonyms under which the data were recorded by mistake."""


class Export(Record):
    """Where data of participants have gone: an export, a report, a workbook."""

    date: str
    exporter: str
    """The writer: an exporter, or a command."""
    folder: str
    files: dict[str, list[str]]
    """The participants in each file, by its path in the folder; none in a shared file."""
    people: list[str] = Field(default_factory=list)
    """All participants whose data went in, while it is being written as well."""
    whole: bool = False
    """Whether every part of it was computed from all participants' data: it cannot be edited."""
    staging: str = ""
    """Folder in which it is being written; gone once everything has its place."""


class Tombstone(Record):
    """Erasure record of a participant."""

    participant: str
    date: str
    reason: str


class OwedRemoval(Record):
    """Copies under a pseudonym that are to be removed once their folder can be reached."""

    participant: str
    to: str | None = None
    """The right pseudonym; None when the participant was erased."""
    folder: str
    files: dict[str, list[str]] = Field(default_factory=dict)
    """The participants in each file of an export; empty for a store."""
    whole: bool = False
    """Whether the export cannot be edited, and goes as a whole."""
    staging: str = ""
    """Folder in which it was being written when its writer was killed."""
    reached: bool = False
    """Whether the folder was found again: what is missing there now was removed by us."""
    link: bool = False
    """Whether the folder is a link, which is never followed: due until it is gone."""


class Work(Record):
    """An operation that was begun, and that the next command has to finish."""

    kind: Literal["erase", "relabel"]
    participant: str
    to: str = ""
    reason: str = ""
    date: str
    reached: list[str] = Field(default_factory=list)
    """Folders outside of the data folder that were there when it began."""


class Merge(Record):
    """Another data folder of the study whose register was entered into this one."""

    date: str
    folder: str
    """Where it was."""
    register_sha256: str
    participants: list[str]
    """Everyone who was in its register."""


class Register(Record):
    """Everything that is kept about the participants of one study."""

    format: Literal["labcrane register"] = "labcrane register"
    format_version: Literal[1] = 1
    study: str = ""
    pattern: str = ""
    """Pattern of the study's pseudonyms."""
    participants: dict[str, Entry] = Field(default_factory=dict)
    exports: list[Export] = Field(default_factory=list)
    stores: dict[str, dict[str, str]] = Field(default_factory=dict)
    """The lab's stores, and the SHA-256 of every file that labcrane has put there."""
    tombstones: list[Tombstone] = Field(default_factory=list)
    owed: list[OwedRemoval] = Field(default_factory=list)
    merges: list[Merge] = Field(default_factory=list)
    shared_slots: list[int] = Field(default_factory=list)
    """Slots that laboratories had handed out before their registers were merged."""
    work: Work | None = None

    @property
    def locks(self) -> dict[str, str]:
        """Seals of the locks under which people took part, each with who did first, in words."""
        found: dict[str, str] = {}
        for name, entry in self.participants.items():
            for each in entry.sessions:
                found.setdefault(each.lock, f"{name}, session {each.session} of {each.date}")
        return found

    def check_finished(self) -> None:
        """Raise :class:`ProtocolError` while something that was begun is not finished."""
        if self.work is not None:
            raise ProtocolError(
                f"labcrane {self.work.kind} {self.work.participant} was interrupted; any call of "
                "labcrane erase, relabel or transfer finishes it"
            )

    def check_study(self, study: str) -> None:
        """Raise :class:`ProtocolError` when this is the register of another study."""
        if self.study not in {"", study}:
            raise ProtocolError(
                f"the register is of study {self.study!r}, the protocol of {study!r}; give the "
                "study's own data folder with --data"
            )

    def entry(self, participant: str) -> Entry:
        """Return a participant, or say who there is."""
        if participant in self.participants:
            return self.participants[participant]
        for stone in self.tombstones:
            if stone.participant == participant:
                raise ProtocolError(
                    f"participant {participant} was erased on {stone.date}; nothing more can be "
                    "recorded about them"
                )
        known = ", ".join(sorted(self.participants)) or "nobody"
        raise ProtocolError(f"participant {participant} is not in the register; it has {known}")

    def names(self) -> list[str]:
        """Return every pseudonym that was ever in the register, those of the erased too."""
        erased = [stone.participant for stone in self.tombstones]
        pending = [self.work.participant] if self.work else []
        return sorted({*self.participants, *erased, *pending})

    def holders(self) -> dict[int, list[str]]:
        """Return who holds which slot: one participant, or several after a merge."""
        found: dict[int, list[str]] = {}
        for name, entry in self.participants.items():
            if entry.holds_slot:
                found.setdefault(entry.slot, []).append(name)
        return found

    def slots(self) -> list[int]:
        """Return the slots that are held, each as often as it is."""
        return [slot for slot, names in self.holders().items() for _ in names]


def read(places: Places) -> Register:
    """Return the present register; an empty one if there is none.

    Raises
    ------
    RecordingError
        It cannot be read, or was edited into something impossible.
    """
    path = places.register
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return Register()
    try:
        register = Register.model_validate(json.loads(text, object_pairs_hook=_each_once))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise RecordingError(_damaged(places, f"{where}: {first['msg']}")) from error
    except ValueError as error:
        raise RecordingError(_damaged(places, str(error))) from error
    for slot, names in register.holders().items():
        if len(names) > 1 and slot not in register.shared_slots:
            both = f"{' and '.join(names)} both have slot {slot}"
            raise RecordingError(_damaged(places, both))
    return register


UNREGISTERED = (
    "not in the register: consent, slot, notes and exclusion are unknown here; labcrane merge "
    "takes them from the data folder in which the recordings were made"
)


ERASED = "erased: and recordings are here, which labcrane erase removes"


def unregistered(places: Places) -> dict[str, str]:
    """Return whose recordings are in the data folder but not in its register, and what that means.

    Pilots and simulations are in no register.
    """
    register = read(places)
    known = {*register.participants, *([register.work.participant] if register.work else [])}
    erased = {stone.participant for stone in register.tombstones}
    names = [each.name for each in recorded(places.root)]
    return {
        name: ERASED if name in erased else UNREGISTERED
        for name in names
        if DataFolder.pseudonym(name) == name and name not in known
    }


def struck(places: Places) -> "dict[str, Struck]":
    """Return the participants that the register excludes, and why; none without a register."""
    from labcrane.analysis.cohort import Status  # noqa: PLC0415 - with what reads recordings

    register = read(places)
    found = {
        stone.participant: (Status.ERASED, f"on {stone.date}: {stone.reason}")
        for stone in register.tombstones
    }
    for name, entry in register.participants.items():
        if entry.exclusion is not None:
            why = f"on {entry.exclusion.date}: {entry.exclusion.reason}"
            found[name] = (Status.EXCLUDED, why)
    return found


def _damaged(places: Places, why: str) -> str:
    return f"the register {places.register} is damaged: {why}; restore it from a backup"


def _each_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"{key!r} is in it twice")
        found[key] = value
    return found


@contextmanager
def changed(places: Places) -> Iterator[Register]:
    """Give the register to be changed; it is written when the block ends without an error."""
    with exclusive(places.register_lock):
        register = read(places)
        yield register
        text = register.model_dump_json(indent=1)
        write_text(places.register, text + "\n")


def begun(places: Places, work: Work, check: Callable[[Register], None]) -> None:
    """Write down what is about to be done, after ``check`` has let it pass."""
    with changed(places) as register:
        register.check_finished()
        check(register)
        register.work = work
