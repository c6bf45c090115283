"""Finished sessions are copied to the lab's store, and both sides proved equal."""

from pathlib import Path

import pytest
from governance.kept_people import KILLS, REASON, check_erased, copied, files, killed_at, store_of
from governed import TODAY, Lab

from labcrane import RecordingError
from labcrane.participants import recovery as unfinished


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
    foreign.write_text("somebody else's", encoding="utf-8")
    done = unfinished.move(lab.places, store_of(lab))
    assert foreign.read_text(encoding="utf-8") == "somebody else's"
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
