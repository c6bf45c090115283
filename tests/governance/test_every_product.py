"""Every product of every command, for people whose names overlap: one is erased, or relabelled.

Making them takes longer than anything else in this folder, so the tests of them are long ones.
"""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import pytest
from governance.every_product import (
    EXPORTS,
    PEOPLE,
    RUN,
    Snapshot,
    everything,
    files,
    killed_and_finished,
    own,
    says,
)
from governance.kept_people import REASON
from governed import TODAY, Lab
from needs import GRAPHICS, missing, needs
from programs import ran

from labcrane.analysis import Exporter
from labcrane.cli.app import COMPLETING, commands
from labcrane.participants import recovery
from labcrane.participants.copies import inventory
from labcrane.participants.register import read
from labcrane.testing import discover, main

KILLED = pytest.mark.parametrize(
    ("numbers", "least"),
    [
        pytest.param((5, 40, 95), 3, marks=pytest.mark.long, id="at some writes"),
        pytest.param(range(1, 10_000), 100, marks=pytest.mark.soak, id="at every write"),
    ],
)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Snapshot:
    folder = tmp_path_factory.mktemp("every") / "product"
    everything(folder)
    return Snapshot(folder)


def root_of(lab: Lab) -> Path:
    return lab.folder.parent


def erased(lab: Lab, name: str, before: dict[str, dict[str, str]]) -> None:
    """Open every file that is left."""
    left = [path for path in root_of(lab).rglob("*") if path.is_file()]
    assert len(left) > 60
    assert [path for path in left if path != lab.places.register and says(path, name)] == []
    assert not [path for path in root_of(lab).rglob("*") if path.is_dir() and says_name(path, name)]
    assert lab.places.register.read_text(encoding="utf-8").count(f'"{name}"') == 1  # the tombstone
    for other in PEOPLE:
        if other != name:
            assert own(root_of(lab), other) == before[other]
    elsewhere = root_of(lab) / "elsewhere"
    assert (elsewhere / "tables" / "read.R").is_file()
    assert (lab.places.exports / "psychds" / "dataset_description.json").is_file()
    assert list((elsewhere / "report").rglob("*")) == []
    assert not list(lab.places.root.glob("evaluation.*"))
    assert list((elsewhere / "power").rglob("*")) == []
    planned = pd.read_csv(elsewhere / "plan.csv")["participant"]
    assert list(planned) == [each for each in ("P001", "P002", "P003", "P004") if each != name]
    if not any(map(missing, GRAPHICS)):  # nothing in a picture says whose movement it shows
        seen = [root_of(lab) / "elsewhere" / f"seen{number}" for number in range(len(PEOPLE))]
        assert [bool(list(each.glob("*.png"))) for each in seen] == [n != name for n in PEOPLE]
    rest = sorted(set(PEOPLE) - {name})
    for table in ("trials", "events", "participants"):
        found = pd.read_csv(elsewhere / "tables" / f"{table}.csv")
        assert sorted(set(found["participant"])) == rest
    for table in ("trials", "events"):
        found = pd.read_parquet(elsewhere / "tables" / f"{table}.parquet")
        assert sorted(set(found["participant"])) == rest


def says_name(path: Path, name: str) -> bool:
    import re

    words = {name, name.replace("-", "")}
    return bool(words & set(re.split(r"[^A-Za-z0-9-]+", path.name)))


@pytest.mark.long
@pytest.mark.parametrize("name", PEOPLE)
def test_nothing_of_an_erased_person_is_left_and_nothing_of_others_is_touched(
    made: Snapshot, name: str
) -> None:
    lab = made.put_back()
    before = {other: own(root_of(lab), other) for other in PEOPLE}
    assert all(len(each) > 15 for each in before.values())
    assert len(list(lab.places.root.glob("evaluation.*"))) == 2
    assert sum(says(path, name) for path in root_of(lab).rglob("*") if path.is_file()) > 25
    done = recovery.erase(lab.places, name, REASON, TODAY)
    erased(lab, name, before)
    assert done.mentions == []
    assert done.reach.owed == []
    assert len(done.reach.again) == 3  # report, workbook and power


@pytest.mark.long
@needs("Rscript")
def test_the_shared_files_that_stay_work(made: Snapshot) -> None:
    lab = made.put_back()
    recovery.erase(lab.places, "P001", REASON, TODAY)
    tables = root_of(lab) / "elsewhere" / "tables"
    said = ran(
        [
            "Rscript",
            "-e",
            f"source('{tables}/read.R'); x <- read_labcrane('{tables}'); "
            "cat(sort(unique(as.character(x$trials$participant))))",
        ]
    )
    assert said.returncode == 0, said.stderr
    assert said.stdout.split() == ["P0011", "VP-001"]


@KILLED
def test_an_erasure_that_is_killed_is_finished_by_the_next_call(
    made: Snapshot, numbers: Sequence[int], least: int
) -> None:
    lab = made.put_back()
    before = {other: own(root_of(lab), other) for other in PEOPLE}
    killed = killed_and_finished(
        made, numbers,
        lambda lab: recovery.erase(lab.places, "P001", REASON, TODAY),
        lambda lab: bool(read(lab.places).tombstones),
        lambda lab: erased(lab, "P001", before),
    )  # fmt: skip
    assert killed >= least


def relabelled(lab: Lab, before: dict[str, dict[str, str]]) -> None:
    left = [path for path in root_of(lab).rglob("*") if path.is_file()]
    formerly = {lab.places.register, *lab.places.raw("P100").glob("*")}
    formerly |= set((root_of(lab) / "store" / "rehearsal" / "P100").glob("*"))
    assert [path for path in left if path not in formerly and says(path, "P001")] == []
    for other in ("P0011", "VP-001"):
        assert own(root_of(lab), other) == before[other]
    assert (lab.places.raw("P100") / "P100.h5").is_file()
    tables = root_of(lab) / "elsewhere" / "tables"
    for table in ("trials", "events"):
        text, packed = (
            pd.read_csv(tables / f"{table}.csv"),
            pd.read_parquet(tables / f"{table}.parquet"),
        )
        assert sorted(set(text["participant"])) == ["P0011", "P100", "VP-001"]
        assert sorted(set(packed["participant"])) == ["P0011", "P100", "VP-001"]
    assert (tables / "streams" / "P100_ses-01_frames.parquet").is_file()
    assert (tables / "read.R").is_file()


@pytest.mark.long
def test_after_relabelling_the_old_name_is_nowhere_but_on_record(made: Snapshot) -> None:
    lab = made.put_back()
    before = {other: own(root_of(lab), other) for other in PEOPLE}
    recovery.correct(lab.places, "P001", "P100", "typed wrongly", TODAY)
    relabelled(lab, before)


@KILLED
def test_a_relabelling_that_is_killed_is_finished_by_the_next_call(
    made: Snapshot, numbers: Sequence[int], least: int
) -> None:
    lab = made.put_back()
    before = {other: own(root_of(lab), other) for other in PEOPLE}
    killed = killed_and_finished(
        made, numbers,
        lambda lab: recovery.correct(lab.places, "P001", "P100", "typed wrongly", TODAY),
        lambda lab: "P100" in read(lab.places).participants and read(lab.places).work is None,
        lambda lab: relabelled(lab, before),
    )  # fmt: skip
    assert killed >= least


@pytest.mark.long
def test_where_lists_every_file_that_holds_a_person(
    made: Snapshot, capsys: pytest.CaptureFixture[str]
) -> None:
    lab = made.put_back()
    for name in PEOPLE:
        listed = {Path(each.where) for each in inventory(lab.places, name)}
        for path in root_of(lab).rglob("*"):
            if path.is_file() and path.name != "labcrane_export.json" and says(path, name):
                assert listed & {path, *path.parents}, path
    capsys.readouterr()
    assert main(["where", "P0011", "--data", str(lab.places.root)]) == 0
    rows = [
        line.split("│")[2].strip() for line in capsys.readouterr().out.splitlines() if "│" in line
    ]
    said = "".join(rows).replace(" ", "")  # a long way goes on in the next line
    assert "fittedP0011.yaml" in said
    assert "P001/" not in said
    recovery.erase(lab.places, "P0011", REASON, TODAY)
    (each,) = inventory(lab.places, "P0011")
    assert each.state == "erasure record: was erased"


BY_OTHER_MEANS = {"score", "power"}
"""They need more than one short session: what they write with is called by itself."""

IN_THE_DATA_FOLDER = {
    "run", "resume", "consent", "exclude", "note", "waive", "recover", "resync", "erase", "relabel",
    "merge",
}  # fmt: skip
"""They write recordings and the register, which is where erasing begins."""

OF_NOBODY = {
    "demo", "simulate", "doctor", "approve", "amend", "methods",
    "report-problem", "schema", "start", "new-study", "new-plugin", "streams", "record",
    "dmd fit", "dmd plot", "dmd validate",
}  # fmt: skip
"""They write of simulated operators, a computer, a machine or a protocol, and no pseudonym."""

LOOKS = {
    "check": "{lab}/study.yaml",
    "plan": "{lab}/study.yaml --participant P001",
    "participants": "--data {lab}/data",
    "deviations": "--data {lab}/data",
    "where": "P001 --data {lab}/data",
    "plugins show": "aiming",
}
"""They show what there is, and end: with what they are called here."""

PAGES = {"study", "view", "pages"}
"""They show what there is until they are stopped."""


def commands_there_are(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    from typer.main import get_command

    def ends(command: object, words: tuple[str, ...] = ()) -> set[str]:
        inside = getattr(command, "commands", None)
        if inside is None:
            return {" ".join(words)}
        return {end for name, one in inside.items() for end in ends(one, (*words, name))}

    monkeypatch.setenv(COMPLETING, "complete_bash")  # then groups of plugins are filled, too
    found = ends(get_command(commands([])))
    monkeypatch.delenv(COMPLETING)
    return found


@pytest.mark.long
def test_every_command_and_exporter_is_among_those_whose_products_are_erased(
    made: Snapshot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever adds one has to say here what it writes of people, or let it be tried."""
    tried = RUN | BY_OTHER_MEANS | ({"feedback preview"} if any(map(missing, GRAPHICS)) else set())
    known = [tried, IN_THE_DATA_FOLDER, OF_NOBODY, set(LOOKS) - tried, PAGES]
    assert commands_there_are(monkeypatch) == set().union(*known)
    assert sum(map(len, known)) == len(set().union(*known))
    assert set(discover().offers[Exporter]) == set(EXPORTS)


@pytest.mark.long
@pytest.mark.parametrize("name", LOOKS)
def test_a_command_that_only_looks_writes_nothing(made: Snapshot, name: str) -> None:
    lab = made.put_back()
    before = files(root_of(lab))
    words = LOOKS[name].format(lab=lab.folder).split()
    assert main([*name.split(), *words]) == 0
    assert files(root_of(lab)) == before


@pytest.mark.long
@needs("fork")
def test_a_product_whose_writer_is_killed_is_known_and_erased(made: Snapshot) -> None:
    import os
    import signal

    from labcrane.participants.products import product

    lab = made.put_back()
    out = root_of(lab) / "elsewhere" / "half"
    child = os.fork()
    if child == 0:
        try:
            with product(lab.places.root, "tables", out, PEOPLE, TODAY) as making:
                (making.folder / "P001.csv").write_text("P001\n", encoding="utf-8")
                os.kill(os.getpid(), signal.SIGKILL)
        finally:
            os._exit(1)
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status)
    assert [path.name for path in out.rglob("*.csv")] == ["P001.csv"]
    assert "not finished" in {each.state for each in inventory(lab.places, "P001")}
    recovery.erase(lab.places, "P001", REASON, TODAY)
    assert not list(out.rglob("*.csv"))


@pytest.mark.long
def test_an_empty_mount_point_is_not_taken_for_the_disk(made: Snapshot) -> None:
    lab = made.put_back()
    disk = root_of(lab) / "elsewhere" / "tables"
    away = disk.with_name("unplugged")
    disk.rename(away)
    disk.mkdir()  # what is left where a stick was mounted
    done = recovery.erase(lab.places, "P001", REASON, TODAY)
    assert [owed.folder for owed in done.reach.owed] == [str(disk)]
    recovery.move(lab.places, root_of(lab) / "store")
    assert [each.state for each in inventory(lab.places, "P001")][1:] == [
        "due: to be erased or relabelled"
    ]
    disk.rmdir()
    away.rename(disk)
    recovery.move(lab.places, root_of(lab) / "store")
    assert not [path for path in disk.rglob("*") if path.is_file() and says(path, "P001")]
    assert (disk / "streams" / "P0011_ses-01_frames.parquet").is_file()
    assert read(lab.places).owed == []


@pytest.mark.long
def test_files_of_others_in_the_same_folder_stay(made: Snapshot) -> None:
    lab = made.put_back()
    report = root_of(lab) / "elsewhere" / "report"
    (report / "my notes.txt").write_text("nobody in particular", encoding="utf-8")
    (report / "empty").mkdir()
    recovery.erase(lab.places, "P001", REASON, TODAY)
    assert files(report) == files(report) != {}
    assert sorted(path.name for path in report.iterdir()) == ["empty", "my notes.txt"]
