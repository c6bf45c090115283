"""Yoked control: whose values of estimates a session gets, chosen once and kept in the register.

The values are copied into the folder of the yoked participant when the source is chosen, so that
the session needs no other folder, also when it is resumed.
"""

import shutil
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from labcrane.analysis.cohort import unfinished
from labcrane.analysis.tables.measure_cache import FOLDER
from labcrane.design.plan import slot_by_name
from labcrane.design.slots import group_of, slots_before
from labcrane.errors import ProtocolError, RecordingError
from labcrane.files.atomic import give_name, make_folder, replacing
from labcrane.files.lock import held
from labcrane.participants.copies import (
    Reach,
    concerns,
    edit_exports,
    forget_export,
    forget_store,
    remove_from_stores,
)
from labcrane.participants.folders import Places
from labcrane.participants.register import Register, Work, Yoke, changed, struck
from labcrane.protocol.estimated import OthersValues, estimate_signals
from labcrane.protocol.study import Study
from labcrane.recording.data_folder import DataFolder, recorded
from labcrane.recording.participant_file.reader import Recording, SessionRecord
from labcrane.recording.participant_file.relabel import (
    ERASED,
    Rewriting,
    relabel_journal,
    relabel_participant_file,
)
from labcrane.recording.participant_file.writer import group_name
from labcrane.recording.paths import participant_path
from labcrane.types import FloatArray

STAGING = ".rewritten"
"""Folder in which a journal is written once more; its name says which part it is."""

Values = dict[str, FloatArray]


def yoke(study: Study, folder: DataFolder, session: int, slot: int | None) -> dict[str, Any]:
    """Return which estimates of a session are yoked, and to whom; empty for own values.

    The first call chooses, and writes the choice into the register; later ones give the same. The
    source has completed the session with values of its own, and is no other's of the same group. It
    is that of an earlier session where possible, or one that other groups use least.

    Raises
    ------
    ProtocolError
        Sessions of other participants come before this one. The same check is made for all groups.
    """
    name, groups = study.protocol.study, tuple(study.protocol.design.groups)
    slot = slot or slot_by_name(folder.participant)
    group = group_of(name, groups, slot)
    names = [each for each, settings in study.estimates.items() if group in settings.yoked]
    yoked = {each for settings in study.estimates.values() for each in settings.yoked}
    before = slots_before(name, groups, yoked, slot)
    path = copy_path(folder.path, session)
    with changed(Places(folder.root)) as register:
        register.check_finished()
        known = _row(register, folder.name, session)
        if session not in folder.sessions():
            sources = dict(_sources(study, folder, session, yoked))
            if known is None or known.source not in sources:
                source = _choice(register, folder, session, group, sources)
                if len(sources) < len(before) or (names and source is None):
                    raise ProtocolError(
                        f"session {session} of {folder.name} cannot be run yet: it comes after "
                        "those of other participants; labcrane plan shows after which"
                    )
                register.yokes = [each for each in register.yokes if each is not known]
                known = None
                if names and source is not None:
                    known = Yoke(
                        participant=folder.name,
                        session=session,
                        group=group,
                        source=source,
                        values=[
                            f"{each}.{value}"
                            for each in names
                            for value in study.estimates[each].values
                        ],
                    )
                    register.yokes.append(known)
                path.unlink(missing_ok=True)
            if not path.exists():
                folder.make()
                # Everyone of such a study has this file: that it is there tells no group.
                _save(path, _values(sources[known.source], names, study) if known else {})
    return {"yoked_to": known.source, "yoked": names} if known else {}


def _sources(
    study: Study, folder: DataFolder, session: int, yoked: set[str]
) -> Iterator[tuple[str, SessionRecord]]:
    """Yield who has completed a session with own values of every estimate, and the recording."""
    excluded = struck(Places(folder.root))
    columns = [name for each in study.estimates for name in _columns(study, each)]
    for other in recorded(folder.root):
        same = DataFolder(
            folder.root, DataFolder.pseudonym(other.name), folder.pilot, folder.simulated
        )
        path = participant_path(other)
        if same.path != other or same.participant in excluded or not path.exists():
            continue  # of another kind, or without a file yet
        try:
            record = Recording(path).session(session)
            if (
                record.context["group"] not in yoked
                and unfinished(record) is None
                and {*columns} <= {*record.streams["input"].units}
            ):
                yield other.name, record
        except RecordingError:
            continue  # without this session, or damaged: not complete, which other commands report


def _columns(study: Study, estimate: str) -> list[str]:
    return [each.name for each in estimate_signals(estimate, study.estimates[estimate])]


def _row(register: Register, participant: str, session: int) -> Yoke | None:
    rows = (each for each in register.yokes if each.participant == participant)
    return next((each for each in rows if each.session == session), None)


def _choice(
    register: Register, folder: DataFolder, session: int, group: str, sources: Mapping[str, Any]
) -> str | None:
    """Return the source for a session; None if every one is another's of the group."""
    own = {each.source for each in register.yokes if each.participant == folder.name}
    others = [
        each
        for each in register.yokes
        if each.session == session
        and each.participant != folder.name
        and not _is_excluded(register, each.participant)
    ]
    used = Counter(each.source for each in others)
    taken = {each.source for each in others if each.group == group}
    left = [name for name in sources if name not in taken]
    return min(left, key=lambda name: (name not in own, used[name], name), default=None)


def _is_excluded(register: Register, name: str) -> bool:
    entry = register.participants.get(DataFolder.pseudonym(name))
    return entry is not None and entry.exclusion is not None


def _values(record: SessionRecord, estimates: Sequence[str], study: Study) -> Values:
    """Return when a session's ticks were due, when its trials began, and rows of its estimates."""
    streams = record.streams
    loop = streams["loop"].columns(("due", "trial", "elapsed"))
    due, trial = loop["due"], loop["trial"]
    begun = (np.diff(trial, prepend=0.0) != 0.0) | (np.diff(loop["elapsed"], prepend=0.0) < 0.0)
    rows = {
        name: np.column_stack(list(streams["input"].columns(_columns(study, name)).values()))
        for name in estimates
    }
    return {"due": due, "begun": np.column_stack([trial[begun], due[begun]]), **rows}


def copy_path(folder: Path, session: int) -> Path:
    """Return the file with the values that a session gets."""
    return folder / f"{group_name(session)}_estimates.npz"


def _save(path: Path, values: Values) -> None:
    with replacing(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, **values)  # type: ignore[arg-type]  # no array is called so


def others_values(
    study: Study, folder: DataFolder, session: int, yoked: Mapping[str, Any]
) -> dict[str, OthersValues]:
    """Return what a session with this context gets instead of its own values, by estimate.

    Of a source that was erased meanwhile there are none, and the fallback is used.
    """
    if not yoked:
        return {}
    path = copy_path(folder.path, session)
    try:
        with np.load(path, allow_pickle=False) as file:
            values = dict(file)
    except (OSError, ValueError) as error:
        raise RecordingError(
            f"{path} cannot be read, and the session needs it: {error}; restore it from a backup"
        ) from error
    empty = np.empty((0, 2))
    # The last attempt at a trial replaces those before it.
    starts = {int(trial): due for trial, due in values.get("begun", empty).tolist()}
    return {
        name: OthersValues(
            values.get("due", empty[:, 0]),
            starts,
            values.get(name, empty),
            study.estimates[name].at_most_age_s,
        )
        for name in yoked["yoked"]
    }


def yoked_to(register: Register, participant: str) -> list[Yoke]:
    """Return the choices of a participant as a source, pilots and simulations too."""
    return [each for each in register.yokes if DataFolder.pseudonym(each.source) == participant]


def yoked_people(register: Register, participant: str) -> set[str]:
    """Return the pseudonyms of those who are yoked to a participant."""
    return {DataFolder.pseudonym(each.participant) for each in yoked_to(register, participant)}


def end_yokes(places: Places, register: Register, work: Work) -> None:
    """Bring the register up to what :func:`follow` has done."""
    for person in yoked_people(register, work.participant):
        forget_export(places, register, person, None)
        forget_store(register, person)
    for each in yoked_to(register, work.participant):
        each.source = _renamed(each.source, work)
    for each in register.yokes:
        if DataFolder.pseudonym(each.participant) == work.participant:
            each.participant = _renamed(each.participant, work)
    register.yokes = [each for each in register.yokes if each.participant]


@contextmanager
def _idle(folder: Path) -> Iterator[None]:
    """Hold a participant's folder against sessions."""
    with ExitStack() as holding:
        for name in (".run.lock", ".recording.lock"):
            if folder.is_dir():
                refusal = f"a session of {folder.name} is running; wait until it has ended"
                holding.enter_context(held(folder / name, refusal))
        yield


def check_idle(places: Places, register: Register, participant: str) -> None:
    """Refuse while a session that is yoked to a participant is running."""
    for each in yoked_to(register, participant):
        with _idle(places.root / each.participant):
            pass


def follow(places: Places, register: Register, work: Work, reach: Reach) -> None:
    """Rename or empty what those have who are yoked to a participant; may be repeated.

    Their exports and copies in stores are removed, since they can be made again.
    """
    for each in yoked_to(register, work.participant):
        folder = places.root / each.participant
        new = _renamed(each.source, work) or ERASED
        gone = () if work.to else each.values
        change = Rewriting(
            each.source, new, own=False, session=group_name(each.session), values=gone
        )
        with _idle(folder):
            if gone and (copied := copy_path(folder, each.session)).exists():
                _save(copied, {})
            _rewrite(folder, each.session, change, reach)
    for person in yoked_people(register, work.participant):
        reach.again += [
            f"{export.exporter} in {places.root / export.folder}"
            for export in register.exports
            if concerns(export, person) and not export.whole
        ]
        reach.again += [
            f"transfer to {store}"
            for store, files in register.stores.items()
            if any(name.startswith(f"{person}/") for name in files)
        ]
        edit_exports(places, register, person, None, reach)
        remove_from_stores(register, person, reach)


def _renamed(source: str, work: Work) -> str:
    """Return the name of a source after a relabelling; empty after an erasure."""
    return work.to + source.removeprefix(work.participant) if work.to else ""


def _rewrite(folder: Path, session: int, change: Rewriting, reach: Reach) -> None:
    sizes: dict[str, int] = {}
    shutil.rmtree(folder / STAGING, ignore_errors=True)  # left by a process that was killed
    for journal in sorted(folder.glob(f"{group_name(session)}_run*.xdf")):
        make_folder(folder / STAGING)
        relabel_journal(journal, folder / STAGING / journal.name, change)
        give_name(folder / STAGING / journal.name, journal)
        sizes[journal.name] = journal.stat().st_size
        reach.changed.append(str(journal))
    shutil.rmtree(folder / STAGING, ignore_errors=True)
    shutil.rmtree(folder / FOLDER, ignore_errors=True)  # measures of the file as it was
    if (path := participant_path(folder)).exists():
        with replacing(path) as beside:
            relabel_participant_file(path, beside, change, sizes)
        reach.changed.append(str(path))
