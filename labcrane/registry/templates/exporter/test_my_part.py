"""my_part keeps the contract of its role; add what else it promises."""

import csv
from pathlib import Path

import pytest
from my_module import MyPart, MyPartSettings

from labcrane.analysis import Exporter
from labcrane.testing import PARTICIPANT_TRIALS, ExporterContract, make_participant


class TestMyPart(ExporterContract):
    @pytest.fixture
    def exporter(self) -> Exporter:
        return MyPart(MyPartSettings())


def test_every_trial_is_a_row(tmp_path: Path) -> None:
    person = make_participant(tmp_path)
    out = tmp_path / "out"
    out.mkdir()
    MyPart(MyPartSettings(separator=";")).export([person], out)
    with (out / "P001_ses-01.csv").open(newline="") as file:
        rows = list(csv.DictReader(file, delimiter=";"))
    assert [float(row["trial"]) for row in rows] == list(range(1, PARTICIPANT_TRIALS + 1))
    assert {row["participant"] for row in rows} == {"P001"}
