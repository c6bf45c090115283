"""A small study, recorded once for all tests of what comes after."""

from pathlib import Path

import pytest
from once import made_once

from labcrane.analysis import find_cohort
from labcrane.analysis.cohort import Cohort, Status
from labcrane.participants.folders import Places
from labcrane.participants.register import Tombstone, changed
from labcrane.testing import Command, Order
from results.awkward import Awkward
from results.recorded import record, study


@pytest.fixture(scope="session")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three people, one of them without an end, a pilot, a simulation, an erased one, a wreck."""
    return made_once("results", _record, tmp_path_factory.mktemp("results")) / "data"


def _record(root: Path) -> None:
    folder = root / "data"
    chosen = study(root)
    record(chosen, folder, "P001", gaze=True)
    record(chosen, folder, "P002", gaze=True)
    record(chosen, folder, "P003", orders={900: [Command(Order.END)]})
    record(chosen, folder, "P001", pilot=True)
    record(chosen, folder, "P005", simulated=True)
    with changed(Places(folder)) as register:  # what erasing P006 has left
        stone = Tombstone(participant="P006", date="2026-05-01", reason="withdrew")
        register.tombstones.append(stone)
    (folder / "P007").mkdir()
    (folder / "P007" / "ses-01_run.xdf").write_bytes(b"XDF:")


@pytest.fixture(scope="session")
def cohort(data: Path) -> Cohort:
    """Somebody was erased as well, as the register tells."""
    return find_cohort(data, struck={"P006": (Status.ERASED, "on 2026-05-01: withdrew")})


@pytest.fixture(scope="session")
def electrodes(tmp_path_factory: pytest.TempPathFactory) -> Cohort:
    """One person with EEG, eyes and a heart, each on a clock of its own."""

    def record_one(root: Path) -> None:
        record(study(root), root / "data", "P001", gaze=True, eeg=True)

    place = tmp_path_factory.mktemp("electrodes")
    return find_cohort(made_once("electrodes", record_one, place) / "data")


@pytest.fixture(scope="session")
def awkward(tmp_path_factory: pytest.TempPathFactory) -> Awkward:
    """Unlike people, recorded by the program itself."""
    return Awkward(tmp_path_factory.mktemp("awkward"))
