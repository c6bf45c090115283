"""A wrong participant number is repaired everywhere, or nowhere."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from governance.kept_people import KILLS, at_every_write, files, store_of
from governed import TODAY, Lab

import labcrane
from labcrane import ProtocolError
from labcrane.participants import recovery as unfinished
from labcrane.participants.copies import inventory
from labcrane.participants.deviations import all_deviations
from labcrane.participants.register import read
from labcrane.recording import annotate
from labcrane.recording.journal_reader import read_journal
from labcrane.recording.xdf.reader import read_xdf


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


@pytest.mark.slow
@pytest.mark.parametrize("step", [KILLS[0], 23])
def test_a_relabelling_that_is_killed_anywhere_is_finished_by_the_next_call(
    recorded: Lab, tmp_path: Path, step: int
) -> None:
    assert at_every_write(recorded, tmp_path, relabel, check_relabelled, step) > 15


@pytest.mark.slow
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


@pytest.mark.slow
def test_marks_go_along_with_the_right_number_and_are_erased_with_it(lab: Lab) -> None:
    file = lab.places.raw("P007") / "P007.h5"
    time = labcrane.open_recording(file).session(1).streams["state"].time
    annotate(file, 1, float(time[5]), "P007 looked away; not as P0071 did")
    before = labcrane.open_recording(file).session(1).annotations
    unfinished.move(lab.places, store_of(lab))
    stored = store_of(lab) / "rehearsal" / "P007" / "ses-01_annotations.jsonl"
    assert stored.is_file()
    unfinished.correct(lab.places, "P007", "P008", "typed wrongly", TODAY)
    folder = lab.places.raw("P008")
    after = labcrane.open_recording(folder / "P008.h5").session(1).annotations
    assert after["text"].tolist() == ["P008 looked away; not as P0071 did"]
    assert after[["time", "until", "written"]].equals(before[["time", "until", "written"]])
    assert not stored.exists()
    assert (store_of(lab) / "rehearsal" / "P008" / stored.name).is_file()
    assert str(folder) in {each.where for each in inventory(lab.places, "P008")}
    unfinished.erase(lab.places, "P008", "withdrew consent", TODAY)
    left = [path for root in (lab.places.root, store_of(lab))
            for path in root.rglob("*annotations*")]  # fmt: skip
    assert left == []


def test_a_relabelled_file_is_what_recover_would_make_of_its_journals(lab: Lab) -> None:
    from labcrane.recording.participant_file.recover import recover

    relabel(lab)
    (found,) = [r for r in recover(lab.places.root) if r.path.name == "P008.h5"]
    assert (found.done, found.problem) == (None, "")
    with h5py.File(lab.places.raw("P008") / "P008.h5") as file:
        (size,) = file["ses-01/journals/size"][:]
    assert size == (lab.places.raw("P008") / "ses-01_run.xdf").stat().st_size


def test_exports_are_relabelled_too(lab: Lab) -> None:
    relabel(lab)
    tables = lab.places.exports / "tables"
    assert "P008,2.5" in (tables / "trials.csv").read_text(encoding="utf-8")
    assert (tables / "sub-P008_events.tsv").read_text(
        encoding="utf-8"
    ) == "onset\tparticipant\n1.0\tP008\n"
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
        ("P007", r"P007 cannot become 'P007': give another pseudonym"),
        ("Anna", r"P007 cannot become 'Anna': give another pseudonym that matches"),
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
