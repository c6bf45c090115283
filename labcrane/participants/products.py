"""Files with or about participants, entered into the register before the first one is written.

Their writer, a command or a plugin, receives the folder for them, so that no file is missed: all
files in it at the end are known by name. A kill in the middle leaves a folder that the register
lists as unfinished.

A file that is not known to be one person's belongs to everybody, and goes with the first who is
erased: a plugin without declarations loses files and keeps the promise.
"""

import fnmatch
import os
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import date, datetime
from pathlib import Path
from typing import TypeVar

from labcrane.errors import ProtocolError
from labcrane.files.atomic import UNFINISHED, give_name, make_folder, sync_folder
from labcrane.files.lock import held
from labcrane.files.names import file_name_of
from labcrane.participants.copies import MANIFEST, enter, kept_folder
from labcrane.participants.folders import Places
from labcrane.participants.mentions import Mentions
from labcrane.participants.register import Export, changed, read
from labcrane.recording.data_folder import DataFolder

Someone = TypeVar("Someone")

WRITING = ".labcrane.lock"
"""Lock in a folder that is being written into."""


class Product:
    """What is being written.

    Attributes
    ----------
    folder
        Where files are to be put while they are written.
    """

    def __init__(self, folder: Path, people: Sequence[str], shared: Sequence[str]) -> None:
        self.folder = folder
        self._people = list(dict.fromkeys(map(DataFolder.pseudonym, people)))
        self._shared = shared
        self._mentions = Mentions(self._people)
        self._in_hand: dict[str, set[str]] = {}
        self._seen: dict[str, tuple[int, int]] = {}

    @property
    def people(self) -> list[str]:
        """Pseudonyms of all participants whose data go in, without suffixes."""
        return self._people

    def handing_out(self, people: Iterable[tuple[str, Someone]]) -> Iterator[Someone]:
        """Yield each person's data, and note which files are written while they are in hand."""
        self._note(set(self._people))
        for name, each in people:
            yield each
            self._note({DataFolder.pseudonym(name)})

    def files(self) -> dict[str, list[str]]:
        """Return the participants in each file that was written.

        A file belongs to one participant alone when it is named after that participant only, and
        nothing was written into it while the data of another were processed. A file that the
        exporter declares to be shared contains no participant's data. Any other file may contain
        the data of all.
        """
        self._note(set(self._people))
        return {name: self._who(name) for name in sorted(self._in_hand)}

    def _who(self, name: str) -> list[str]:
        if any(fnmatch.fnmatchcase(name, pattern) for pattern in self._shared):
            return []
        named, handed = self._mentions.of(name), self._in_hand[name]
        if name != MANIFEST and len(named) == 1 and named <= handed:
            alone = handed == named or handed == set(self._people)
            return sorted(named) if alone else sorted(handed)
        return sorted(self._people)

    def _note(self, people: set[str]) -> None:
        for path in self.folder.rglob("*"):
            if not path.is_file() and not path.is_symlink():
                continue
            name = path.relative_to(self.folder).as_posix()
            about = path.lstat()
            now = (about.st_mtime_ns, about.st_size)
            if self._seen.get(name) != now:
                self._seen[name] = now
                self._in_hand.setdefault(name, set()).update(people)


@contextmanager
def product(
    data: Path,
    exporter: str,
    target: Path,
    people: Sequence[str],
    today: date,
    *,
    shared: Sequence[str] = (),
    whole: bool = False,
    empty: bool = False,
) -> Iterator[Product]:
    """Hand out a folder for files with or about participants; they go to ``target`` at the end.

    Parameters
    ----------
    data
        The study's data folder, whose register keeps it.
    exporter
        The writer: an exporter, or a command.
    target
        The folder in which the files are to be; others in it stay, those of the same name do not.
    people
        Whose data go in, by the names of their folders.
    shared
        Patterns of files that contain no participant's data.
    whole
        Whether everything is computed from all participants' data, so that it is removed whole.
    empty
        Whether nothing may be in ``target`` before.

    Raises
    ------
    ProtocolError
        It is not ``empty``.
    RecordingError
        Another process is writing into it.
    """
    places, target = Places(data), target.resolve()
    fresh = not target.exists()
    make_folder(target)
    refusal = f"another labcrane is writing into {target}; wait for it, or give another folder"
    try:
        with held(target / WRITING, refusal):
            if empty:
                check_empty(target)
            with _written(places, exporter, target, people, today, shared, whole=whole) as made:
                yield made
    finally:
        if fresh and target.is_dir() and not any(target.iterdir()):
            target.rmdir()


def check_empty(folder: Path) -> None:
    """Refuse a folder in which there is more than what a killed writer left.

    Raises
    ------
    ProtocolError
        There is.
    """
    there = folder.iterdir() if folder.exists() else ()
    if any(each.name != WRITING and not each.name.endswith(UNFINISHED) for each in there):
        raise ProtocolError(f"{folder} is not empty, and nothing is overwritten; give a new folder")


@contextmanager
def _written(
    places: Places,
    exporter: str,
    target: Path,
    people: Sequence[str],
    today: date,
    shared: Sequence[str],
    *,
    whole: bool,
) -> Iterator[Product]:
    staging = target / f".{file_name_of(exporter)}{UNFINISHED}"
    made = Product(staging, people, shared)
    entry = Export(
        date=today.isoformat(),
        exporter=exporter,
        folder=kept_folder(places, target),
        files={},
        people=sorted(made.people),
        whole=whole,
        staging=kept_folder(places, staging),
    )
    # Simulated data belong to no person: without people there is nothing to keep track of.
    tracked = places.register.exists() or not all(map(DataFolder.is_simulated, people))
    if tracked:
        with changed(places) as register:
            register.check_finished()
            enter(places, register, entry.model_copy(deep=True))
    shutil.rmtree(staging, ignore_errors=True)
    make_folder(staging)
    try:
        yield made
        entry.files = made.files()
        if tracked:
            with changed(places) as register:
                enter(places, register, entry.model_copy(deep=True))
        _put(staging, target)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        if tracked and read(places).work is None:
            with changed(places) as register:
                _settle(places, register.exports, entry)
                register.exports = [each for each in register.exports if each.files]


@contextmanager
def files_about(recording: Path, writer: str, target: Path) -> Iterator[Path]:
    """Hand out a folder for files about the participant of a participant file.

    They are in ``target`` at the end, and in the register of the study that the participant file
    is of.

    Parameters
    ----------
    recording
        The participant file, in its place in the data folder.
    writer
        The writer: ``feedback preview``.
    """
    recording, target = recording.resolve(), target.resolve()
    data, name = recording.parent.parent, recording.parent.name
    today = datetime.now().astimezone().date()
    if recording.stem != name or not recording.is_file():  # a copy in another place
        yield target
        return
    with product(data, writer, target, [name], today) as made:
        yield made.folder


@contextmanager
def written_about(recording: Path, writer: str, path: Path) -> Iterator[Path]:
    """Hand out a path for one file about the participant of a participant file.

    As :func:`files_about`. For commands of plugins.
    """
    path = path.resolve()
    with files_about(recording, writer, path.parent) as folder:
        yield folder / path.name


def _put(staging: Path, target: Path) -> None:
    """Give every file its place, each whole."""
    make_folder(target)
    for path in sorted(staging.rglob("*")):
        place = target / path.relative_to(staging)
        if path.is_dir() and not path.is_symlink():
            make_folder(place)
        else:
            give_name(path, place)
    sync_folder(target)


def _settle(places: Places, exports: Sequence[Export], entry: Export) -> None:
    """Note that writing has ended, and the files that exist now."""
    for each in exports:
        if (each.folder, each.exporter) == (entry.folder, entry.exporter):
            each.staging = ""
            folder = places.root / each.folder
            each.files = {
                name: who for name, who in each.files.items() if os.path.lexists(folder / name)
            }
