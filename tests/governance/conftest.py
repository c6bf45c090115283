"""A lab with recorded people, made once, and a copy of it for each test."""

import csv
from pathlib import Path

import pytest
from governance.kept_people import copied, lab_in
from governance.written import record_export
from governed import GROUPED, TODAY, Lab
from once import made_once


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """Return a study with the sessions of three participants, and an export of them."""
    return lab_in(made_once("governance", _record, tmp_path_factory.mktemp("lab")))


def _record(folder: Path) -> None:
    lab = Lab(folder, GROUPED)
    lab.approve()
    for name in ("P001", "P002", "P007"):
        lab.run(name)
    tables = lab.places.exports / "tables"
    tables.mkdir(parents=True)
    rows = [["participant", "movement_time"], ["P001", "1.5"], ["P007", "2.5"], ["P002", "3.5"]]
    with (tables / "trials.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)
    (tables / "sub-P007_events.tsv").write_text("onset\tparticipant\n1.0\tP007\n", encoding="utf-8")
    (tables / "all.mat").write_bytes(b"binary\x00 P001 P007")
    (tables / "P001.txt").write_text("P001 only", encoding="utf-8")
    files = {
        Path("trials.csv"): ["P001", "P002", "P007"],
        Path("sub-P007_events.tsv"): ["P007"],
        Path("all.mat"): ["P001", "P007"],
        Path("P001.txt"): ["P001"],
    }
    record_export(lab.places, "tables", tables, files, TODAY)


@pytest.fixture
def lab(recorded: Lab, tmp_path: Path) -> Lab:
    """Return a copy of the study that may be changed, with a store beside it."""
    return copied(recorded, tmp_path)
