"""The register: edited by hand, by several processes at once, and killed while it is written."""

import multiprocessing
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from governed import GROUPED, Lab
from needs import needs

from labcrane import ProtocolError, RecordingError
from labcrane.participants.folders import Places
from labcrane.participants.register import changed, read
from labcrane.session.eligibility import check_eligibility


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    lab = Lab(tmp_path)
    lab.approve()
    return lab


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda text: text[:100], "is damaged: .*; restore it from a backup"),
        (lambda text: text.replace('"P002"', '"P001"'), "'P001' is in it twice"),
        (lambda text: text.replace('"slot": 2', '"slot": 1'), "P001 and P002 both have slot 1"),
        (lambda text: text.replace('"slot": 2', '"slot": 0'), "slot: .* greater than or equal to"),
    ],
)  # fmt: skip
def test_a_register_edited_into_the_impossible_is_refused(lab: Lab, edit, said: str) -> None:
    for name in ("P001", "P002"):
        lab.consent(name)
    lab.places.register.write_text(
        edit(lab.places.register.read_text(encoding="utf-8")), encoding="utf-8"
    )
    with pytest.raises(RecordingError, match=said):
        check_eligibility(lab.visit("P001"))


def test_another_studys_register_is_refused(lab: Lab) -> None:
    lab.consent("P001")
    with changed(lab.places) as register:
        register.study = "welding"
    with pytest.raises(ProtocolError, match="the register is of study 'welding', the protocol of"):
        check_eligibility(lab.visit("P001"))
    with pytest.raises(ProtocolError, match="the register is of study 'welding', the protocol of"):
        lab.consent("P002")


def _enrol(folder: Path, names: list[str]) -> None:
    lab = Lab.__new__(Lab)
    lab.folder, lab.protocol = folder, folder / "study.yaml"
    lab.places = Places(folder / "data")
    for name in names:
        lab.consent(name)


@pytest.mark.slow
@needs("fork")
def test_processes_that_write_at_once_lose_nothing_and_share_no_slot(tmp_path: Path) -> None:
    lab = Lab(tmp_path, GROUPED)
    lab.approve()
    names = [f"P{number:03}" for number in range(1, 31)]
    children = [
        multiprocessing.get_context("fork").Process(target=_enrol, args=(tmp_path, names[at::3]))
        for at in range(3)
    ]
    for child in children:
        child.start()
    for child in children:
        child.join()
        assert child.exitcode == 0
    entries = read(lab.places).participants
    assert sorted(entries) == names
    assert sorted(entry.slot for entry in entries.values()) == list(range(1, 31))
    assert set(Counter(entry.group for entry in entries.values()).values()) == {10}


WRITER = """
import sys
from pathlib import Path
from labcrane.participants.folders import Places
from labcrane.participants.register import Entry, changed
number = 0
while True:
    with changed(Places(Path(sys.argv[1]))) as register:
        number = max((entry.slot for entry in register.participants.values()), default=0) + 1
        register.participants[f"P{number:04}"] = Entry(slot=number, seed=1, enrolled="2026-01-01")
    print(number, flush=True)
"""


@pytest.mark.slow
def test_a_kill_during_a_write_leaves_a_whole_register(tmp_path: Path) -> None:
    places, last = Places(tmp_path / "data"), 0
    for round_number in range(1, 6):
        child = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(places.root)],
            stdout=subprocess.PIPE,
            encoding="utf-8",
        )
        with child:
            for _ in range(3):
                last = int(child.stdout.readline())
            time.sleep(0.0011 * round_number)  # somewhere within a write
            child.kill()
        slots = sorted(entry.slot for entry in read(places).participants.values())
        assert slots == list(range(1, len(slots) + 1))
        assert len(slots) >= last
