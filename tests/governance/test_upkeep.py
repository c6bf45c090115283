"""Erase, relabel and transfer: what is left, what is not touched, and what a kill does."""

import csv
import hashlib
import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from governed import GROUPED, TODAY, Lab

import labcrane
from labcrane import ProtocolError, RecordingError
from labcrane.participants import unfinished
from labcrane.participants.copies import record_export
from labcrane.participants.deviations import all_deviations
from labcrane.participants.places import Places
from labcrane.participants.register import read
from labcrane.recording.journal_reader import read_journal
from labcrane.recording.xdf_reader import read_xdf

REASON = "withdrew consent"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """Return a study with the sessions of three participants, and an export of them."""
    lab = Lab(tmp_path_factory.mktemp("lab"), GROUPED)
    lab.approve()
    for name in ("P001", "P002", "P007"):
        lab.run(name)
    tables = lab.places.exports / "tables"
    tables.mkdir(parents=True)
    rows = [["participant", "movement_time"], ["P001", "1.5"], ["P007", "2.5"], ["P002", "3.5"]]
    with (tables / "trials.csv").open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    (tables / "sub-P007_events.tsv").write_text("onset\tparticipant\n1.0\tP007\n")
    (tables / "all.mat").write_bytes(b"binary P001 P007")
    (tables / "P001.txt").write_text("P001 only")
    files = {
        Path("trials.csv"): ["P001", "P002", "P007"],
        Path("sub-P007_events.tsv"): ["P007"],
        Path("all.mat"): ["P001", "P007"],
        Path("P001.txt"): ["P001"],
    }
    record_export(lab.places, "tables", tables, files, TODAY)
    return lab


@pytest.fixture
def lab(recorded: Lab, tmp_path: Path) -> Lab:
    """Return a copy of the study that may be changed, with a store beside it."""
    return copied(recorded, tmp_path)


def copied(recorded: Lab, folder: Path) -> Lab:
    shutil.copytree(recorded.folder, folder / "lab")
    (folder / "store").mkdir()
    lab = Lab.__new__(Lab)
    lab.folder, lab.protocol = folder / "lab", folder / "lab" / "study.yaml"
    lab.places = Places(folder / "lab" / "data")
    return lab


def store_of(lab: Lab) -> Path:
    return lab.folder.parent / "store"


def files(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def others(folder: Path) -> dict[str, str]:
    return {name: sha for name, sha in files(folder).items() if "P001/" in name or "P002/" in name}


def check_erased(lab: Lab) -> None:
    """Search every byte that is left, here and in the store."""
    for root in (lab.places.root, store_of(lab)):
        for path in root.rglob("*"):
            assert "P007" not in path.name
            if path.is_file() and path != lab.places.register:
                assert b"P007" not in path.read_bytes(), path
    text = lab.places.register.read_text()
    assert text.count("P007") == 1
    (stone,) = read(lab.places).tombstones
    assert (stone.participant, stone.reason) == ("P007", REASON)
    assert stone.date == TODAY.isoformat()


def test_after_erasing_nothing_but_the_tombstone_is_left(lab: Lab) -> None:
    unfinished.move(lab.places, store_of(lab))
    before = others(lab.folder), others(store_of(lab))
    assert len(before[0]) == len(before[1]) == 4
    done = unfinished.erase(lab.places, "P007", REASON, TODAY)
    check_erased(lab)
    assert (others(lab.folder), others(store_of(lab))) == before
    assert done.mentions == []
    tables = lab.places.exports / "tables"
    assert (tables / "trials.csv").read_text().splitlines() == [
        "participant,movement_time", "P001,1.5", "P002,3.5",
    ]  # fmt: skip
    assert sorted(path.name for path in tables.iterdir()) == ["P001.txt", "trials.csv"]


def test_erasing_frees_the_slot_and_the_pseudonym_never_comes_back(lab: Lab) -> None:
    slot = read(lab.places).participants["P007"].slot
    unfinished.erase(lab.places, "P007", REASON, TODAY)
    lab.consent("P008")
    assert read(lab.places).participants["P008"].slot == slot
    with pytest.raises(ProtocolError, match="P007 was erased; give the next participant a new"):
        lab.consent("P007")
    with pytest.raises(ProtocolError, match="participant P007 was erased on"):
        unfinished.erase(lab.places, "P007", REASON, TODAY)


def test_what_people_wrote_themselves_is_named(lab: Lab) -> None:
    (lab.places.root / "todo.txt").write_text("ask P007 about the second session")
    done = unfinished.erase(lab.places, "P007", REASON, TODAY)
    assert done.mentions == [str(lab.places.root / "todo.txt")]


def test_pilots_and_simulations_under_the_pseudonym_go_too(lab: Lab) -> None:
    for name in ("P007-PILOT", "P007-SIMULATED"):
        (lab.places.root / name).mkdir()
        (lab.places.root / name / f"{name}.h5").write_text("P007")
    unfinished.erase(lab.places, "P007", REASON, TODAY)
    check_erased(lab)


def test_a_store_that_is_not_plugged_in_is_told_and_reached_later(lab: Lab) -> None:
    unfinished.move(lab.places, store_of(lab))
    away = store_of(lab).with_name("unplugged")
    store_of(lab).rename(away)
    done = unfinished.erase(lab.places, "P007", REASON, TODAY)
    assert [owed.folder for owed in done.reach.owed] == [str(store_of(lab))]
    away.rename(store_of(lab))
    unfinished.move(lab.places, store_of(lab))
    check_erased(lab)


def test_an_export_on_another_disk_is_reached_later(lab: Lab, tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    table = disk / "all.csv"
    table.write_text("participant\nP001\nP007\n")
    record_export(lab.places, "bids", disk, {Path("all.csv"): ["P001", "P007"]}, TODAY)
    disk.rename(tmp_path / "away")
    done = unfinished.erase(lab.places, "P007", REASON, TODAY)
    assert [owed.folder for owed in done.reach.owed] == [str(disk)]
    (tmp_path / "away").rename(disk)
    unfinished.move(lab.places, store_of(lab))
    assert table.read_text() == "participant\nP001\n"
    check_erased(lab)


WRITES = frozenset({"os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.truncate", "os.chmod"})


def killed_at(number: int, work: Callable[[], object]) -> bool:
    """Do ``work`` in a process that is killed before its ``number``-th write; whether it was."""
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        seen = [0]

        def watch(event: str, details: tuple) -> None:
            writes = event in WRITES or (
                event == "open"
                and isinstance(details[2], int)
                and details[2] & (os.O_WRONLY | os.O_RDWR)
            )
            if writes:
                seen[0] += 1
                if seen[0] == number:
                    os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(watch)
        try:
            work()
        except BaseException:  # noqa: BLE001 - a child of pytest must never go on as pytest
            os._exit(1)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0, "the work itself failed"
    return os.WIFSIGNALED(status)


# Everywhere on request; here and there, at all kinds of writes, with every change.
KILLS = [pytest.param(1, marks=pytest.mark.soak), 7]


def at_every_write(recorded: Lab, folder: Path, work, check, step: int) -> int:
    """Kill ``work`` before each ``step``-th of its writes, call it again, and check.

    Returns the number of writes, less those after the last kill.
    """
    number = 1
    while True:
        lab = copied(recorded, folder / str(number))
        unfinished.move(lab.places, store_of(lab))
        before = others(lab.folder)
        was_killed = killed_at(number, lambda lab=lab: work(lab))
        if was_killed:
            work(lab)
        check(lab)
        assert others(lab.folder) == before
        shutil.rmtree(folder / str(number))
        if not was_killed:
            return number - step
        number += step


@pytest.mark.parametrize("step", [*KILLS[:1], 2])
def test_an_erasure_that_is_killed_anywhere_is_finished_by_the_next_call(
    recorded: Lab, tmp_path: Path, step: int
) -> None:
    def erase(lab: Lab) -> None:
        if read(lab.places).tombstones:  # it was killed after it was done
            unfinished.move(lab.places, store_of(lab))
        else:
            unfinished.erase(lab.places, "P007", REASON, TODAY)

    assert at_every_write(recorded, tmp_path, erase, check_erased, step) > 15


def test_another_commands_call_finishes_an_erasure_as_well(lab: Lab) -> None:
    assert killed_at(16, lambda: unfinished.erase(lab.places, "P007", REASON, TODAY))
    assert read(lab.places).work is not None
    with pytest.raises(ProtocolError, match="labcrane erase P007 was interrupted; any call of"):
        lab.consent("P009")
    unfinished.move(lab.places, store_of(lab))
    check_erased(lab)


def check_relabelled(lab: Lab) -> None:
    for root in (lab.places.root, store_of(lab)):
        assert not [path for path in root.rglob("*") if "P007" in path.name]
    folder = lab.places.raw("P008")
    assert sorted(path.name for path in folder.iterdir()) == ["P008.h5", "ses-01_run.xdf"]
    stored = store_of(lab) / "rehearsal" / "P008"
    assert files(stored) == files(folder)
    register = read(lab.places)
    assert set(register.participants) == {"P001", "P002", "P008"}
    assert register.participants["P008"].formerly == ["P007"]
    assert register.work is None


def relabel(lab: Lab) -> None:
    register = read(lab.places)
    if "P007" in register.participants or register.work:
        unfinished.correct(lab.places, "P007", "P008", "typed wrongly", TODAY)
    else:  # it was killed after it was done
        unfinished.move(lab.places, store_of(lab))


@pytest.mark.parametrize("step", [KILLS[0], 11])
def test_a_relabelling_that_is_killed_anywhere_is_finished_by_the_next_call(
    recorded: Lab, tmp_path: Path, step: int
) -> None:
    assert at_every_write(recorded, tmp_path, relabel, check_relabelled, step) > 15


def test_relabelling_changes_the_number_and_keeps_everything_else(lab: Lab) -> None:
    unfinished.move(lab.places, store_of(lab))
    before = labcrane.open_recording(lab.places.raw("P007") / "P007.h5").session(1)
    state, context = before.streams["state"].data, before.context
    trials, events = before.trials, before.events
    frames, _ = read_journal([lab.places.raw("P007") / "ses-01_run.xdf"])
    relabel(lab)
    check_relabelled(lab)
    recording = labcrane.open_recording(lab.places.raw("P008") / "P008.h5")
    assert recording.participant == "P008"
    assert recording.attrs["formerly"] == "P007"
    after = recording.session(1)
    np.testing.assert_array_equal(after.streams["state"].data, state)
    assert after.trials.equals(trials)
    assert after.events["name"].equals(events["name"])
    assert after.attrs["participant"] == "P008"
    assert after.context == {**context, "participant": "P008", "formerly": "P007"}
    assert after.context["seed"] == context["seed"]  # what was used was used
    log, _ = read_journal([lab.places.raw("P008") / "ses-01_run.xdf"])
    np.testing.assert_array_equal(log.rows, frames.rows)
    assert log.context["participant"] == "P008"
    assert log.context["formerly"] == "P007"
    assert read_xdf(lab.places.raw("P008") / "ses-01_run.xdf").whole


def test_a_relabelled_file_is_what_recover_would_make_of_its_journals(lab: Lab) -> None:
    from labcrane.recording.recover import recover

    relabel(lab)
    (found,) = [r for r in recover(lab.places.root) if r.path.name == "P008.h5"]
    assert (found.done, found.problem) == (None, "")
    with h5py.File(lab.places.raw("P008") / "P008.h5") as file:
        (size,) = file["ses-01/journals/size"][:]
    assert size == (lab.places.raw("P008") / "ses-01_run.xdf").stat().st_size


def test_exports_are_relabelled_too(lab: Lab) -> None:
    relabel(lab)
    tables = lab.places.exports / "tables"
    assert "P008,2.5" in (tables / "trials.csv").read_text()
    assert (tables / "sub-P008_events.tsv").read_text() == "onset\tparticipant\n1.0\tP008\n"
    (export,) = read(lab.places).exports
    assert export.files["trials.csv"] == ["P001", "P002", "P008"]
    assert not (tables / "all.mat").exists()


def test_the_wrongly_used_slot_and_seed_are_a_deviation(lab: Lab) -> None:
    lab.consent("P008")
    wrong, meant = (read(lab.places).participants[name] for name in ("P007", "P008"))
    relabel(lab)
    ((name, deviation),) = all_deviations(lab.places)
    assert name == "P008"
    assert deviation.what == "wrong participant number"
    assert deviation.detail == (
        f"run as P007, with slot {wrong.slot} (group {wrong.group}) and seed {wrong.seed}, instead "
        f"of slot {meant.slot} (group {meant.group}) and seed {meant.seed}: typed wrongly"
    )
    entry = read(lab.places).participants["P008"]
    assert (entry.slot, entry.group, entry.seed) == (wrong.slot, wrong.group, wrong.seed)


@pytest.mark.parametrize(
    ("new", "said"),
    [
        ("P002", "P002 has recordings of its own; relabel P002 first"),
        ("P007", r"P007 cannot become 'P007': it takes another pseudonym"),
        ("Anna", r"P007 cannot become 'Anna': it takes another pseudonym that matches"),
    ],
)
def test_an_impossible_relabelling_is_refused(lab: Lab, new: str, said: str) -> None:
    before = files(lab.folder)
    with pytest.raises(ProtocolError, match=said):
        unfinished.correct(lab.places, "P007", new, "typed wrongly", TODAY)
    assert files(lab.folder) == before | {
        name: sha for name, sha in files(lab.folder).items() if name.endswith(".lock")
    }


def test_a_number_of_another_length_fits(lab: Lab) -> None:
    unfinished.correct(lab.places, "P007", "P1234", "typed wrongly", TODAY)
    path = lab.places.raw("P1234") / "P1234.h5"
    assert labcrane.open_recording(path).session(1).context["participant"] == "P1234"


def test_transfer_copies_proves_and_lists_what_is_only_here(lab: Lab) -> None:
    unfinished_session = lab.places.raw("P001") / "ses-02_run.xdf"
    (lab.places.root / "P009-PILOT").mkdir()
    unfinished_session.write_bytes((lab.places.raw("P001") / "ses-01_run.xdf").read_bytes())
    done = unfinished.move(lab.places, store_of(lab))
    assert sorted(done.copied) == [
        f"{name}/{file}" for name in ("P001", "P002", "P007")
        for file in (f"{name}.h5", "ses-01_run.xdf")
    ]  # fmt: skip
    assert done.equal == 6
    assert done.only_here == [
        "P001/ses-02: not finished",
        "P009-PILOT: not of a participant in the register; pilots and simulations stay here",
    ]
    store = files(store_of(lab) / "rehearsal")
    here = files(lab.places.root)
    assert len(store) == 6
    assert all(here[name] == sha for name, sha in store.items())
    again = unfinished.move(lab.places, store_of(lab))
    assert (again.copied, again.equal) == ([], 6)


def test_transfer_never_replaces_what_it_did_not_put_there(lab: Lab) -> None:
    foreign = store_of(lab) / "rehearsal" / "P001" / "P001.h5"
    foreign.parent.mkdir(parents=True)
    foreign.write_text("somebody else's")
    done = unfinished.move(lab.places, store_of(lab))
    assert foreign.read_text() == "somebody else's"
    assert done.only_here == [
        f"P001/P001.h5: the store has another file {foreign}, not from labcrane"
    ]


@pytest.mark.parametrize("step", KILLS)
def test_a_transfer_that_is_killed_anywhere_is_finished_by_the_next_call(
    recorded: Lab, tmp_path: Path, step: int
) -> None:
    number = 1
    while True:
        lab = copied(recorded, tmp_path / str(number))
        was_killed = killed_at(number, lambda lab=lab: unfinished.move(lab.places, store_of(lab)))
        unfinished.move(lab.places, store_of(lab))
        raw = {name: sha for name, sha in files(lab.places.root).items() if name.startswith("P")}
        assert files(store_of(lab) / "rehearsal") == raw
        if not was_killed:
            break
        unfinished.erase(lab.places, "P007", REASON, TODAY)
        check_erased(lab)  # a copy that the kill left behind is known, and is reached
        number += step
    assert number > 15


def test_a_store_that_is_not_there_is_refused(lab: Lab) -> None:
    with pytest.raises(RecordingError, match=r"there is no folder .*nowhere; plug the store in"):
        unfinished.move(lab.places, lab.folder / "nowhere")
