"""What erasing leaves, what it does not touch, and what a kill does to it."""

import csv
from pathlib import Path

import pytest
from governance.kept_people import (
    KILLS,
    REASON,
    at_every_write,
    check_erased,
    killed_at,
    others,
    store_of,
)
from governance.written import record_export
from governed import TODAY, Lab

from labcrane import ProtocolError
from labcrane.participants import recovery as unfinished
from labcrane.participants.copies import _rows_without
from labcrane.participants.mentions import Mentions
from labcrane.participants.register import read


@pytest.mark.slow
def test_after_erasing_nothing_but_the_tombstone_is_left(lab: Lab) -> None:
    unfinished.move(lab.places, store_of(lab))
    before = others(lab.folder), others(store_of(lab))
    assert len(before[0]) == len(before[1]) == 4
    done = unfinished.erase(lab.places, "P007", REASON, TODAY)
    check_erased(lab)
    assert (others(lab.folder), others(store_of(lab))) == before
    assert done.mentions == []
    tables = lab.places.exports / "tables"
    assert (tables / "trials.csv").read_text(encoding="utf-8").splitlines() == [
        "participant,movement_time", "P001,1.5", "P002,3.5",
    ]  # fmt: skip
    assert sorted(path.name for path in tables.iterdir()) == ["P001.txt", "trials.csv"]


@pytest.mark.slow
def test_erasing_frees_the_slot_and_the_pseudonym_never_comes_back(lab: Lab) -> None:
    slot = read(lab.places).participants["P007"].slot
    unfinished.erase(lab.places, "P007", REASON, TODAY)
    lab.consent("P008")
    assert read(lab.places).participants["P008"].slot == slot
    with pytest.raises(ProtocolError, match="P007 was erased; give the next participant a new"):
        lab.consent("P007")
    with pytest.raises(ProtocolError, match="participant P007 was erased on"):
        unfinished.erase(lab.places, "P007", REASON, TODAY)


@pytest.mark.slow
def test_what_people_wrote_themselves_is_named(lab: Lab) -> None:
    (lab.places.root / "todo.txt").write_text("ask P007 about the second session", encoding="utf-8")
    done = unfinished.erase(lab.places, "P007", REASON, TODAY)
    assert done.mentions == [str(lab.places.root / "todo.txt")]


@pytest.mark.slow
def test_pilots_and_simulations_under_the_pseudonym_go_too(lab: Lab) -> None:
    for name in ("P007-PILOT", "P007-SIMULATED"):
        (lab.places.root / name).mkdir()
        (lab.places.root / name / f"{name}.h5").write_text("P007", encoding="utf-8")
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


@pytest.mark.slow
def test_an_export_on_another_disk_is_reached_later(lab: Lab, tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    table = disk / "all.csv"
    table.write_text("participant\nP001\nP007\n", encoding="utf-8")
    record_export(lab.places, "bids", disk, {Path("all.csv"): ["P001", "P007"]}, TODAY)
    disk.rename(tmp_path / "away")
    done = unfinished.erase(lab.places, "P007", REASON, TODAY)
    assert [owed.folder for owed in done.reach.owed] == [str(disk)]
    (tmp_path / "away").rename(disk)
    unfinished.move(lab.places, store_of(lab))
    assert table.read_text(encoding="utf-8") == "participant\nP001\n"
    check_erased(lab)


@pytest.mark.slow
@pytest.mark.parametrize("step", [KILLS[0], pytest.param(2, marks=pytest.mark.long), 23])
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


@pytest.mark.parametrize("long", [131_000, 200_000, 2_000_000])
def test_a_table_with_a_cell_of_any_length_is_edited_row_by_row(long: int) -> None:
    """A note, or what a session says of its study, may be longer than csv takes by itself."""
    mentions, limit = Mentions(["P001", "P002"]), csv.field_size_limit()
    rows = ['P001,"' + "a" * long + '"\n', 'P002,"' + "b,\n" * (long // 3) + '"\n']
    assert _rows_without("who,said\n" + "".join(rows), ",", "P001", mentions) == (
        "who,said\n" + rows[1]
    )
    assert csv.field_size_limit() == limit
