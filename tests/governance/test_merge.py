"""One study in several laboratories: their data folders are merged into one."""

import json
import random
import shutil
from itertools import permutations
from pathlib import Path

import pytest
from governance.kept_people import files, killed_at, lab_in
from governed import GROUPED, TODAY, Lab
from needs import needs
from once import made_once

from labcrane import ProtocolError, RecordingError
from labcrane.participants import enrolment
from labcrane.participants import recovery as unfinished
from labcrane.participants.copies import inventory
from labcrane.participants.deviations import all_deviations
from labcrane.participants.folders import Places
from labcrane.participants.register import changed, read
from labcrane.testing import Command, Order, main

SITES = ("hamburg", "dortmund", "aachen")


@pytest.fixture(scope="session")
def recorded_sites(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_once("sites", _record, tmp_path_factory.mktemp("sites"))


def _record(folder: Path) -> None:
    """Approve a study once, copy it to three laboratories, and record one person in each."""
    (folder / SITES[0]).mkdir()
    Lab(folder / SITES[0], GROUPED).approve()
    for site in SITES[1:]:
        shutil.copytree(folder / SITES[0], folder / site)
    orders = {40: [Command(Order.SKIP)], 60: [Command(Order.REPEAT)]}
    for number, site in enumerate(SITES, start=1):
        lab = lab_in(folder / site)
        lab.run(f"P{number}01", orders if number == 2 else None)
        for place in range(2, 3 + number):
            lab.consent(f"P{number}{place:02}")


@pytest.fixture
def sites(recorded_sites: Path, tmp_path: Path) -> dict[str, Lab]:
    shutil.copytree(recorded_sites, tmp_path / "sites")
    return {site: lab_in(tmp_path / "sites" / site) for site in SITES}


def join(lab: Lab, other: Lab):
    from labcrane.approval.lock import read_lock

    lock = read_lock(lab.protocol)
    return unfinished.join(lab.places, other.places, TODAY, lock.replaced | {lock.seal})


def written(lab: Lab) -> dict:
    """Return the register as JSON has it."""
    return json.loads(lab.places.register.read_text(encoding="utf-8"))


def recordings(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file that is not of a register."""
    return {name: sha for name, sha in files(folder).items() if "register/" not in name}


def unsettle(sites: dict[str, Lab], chance: random.Random) -> None:
    """Exclude, note and waive at random in every laboratory."""
    for lab in sites.values():
        for name in read(lab.places).participants:
            if chance.random() < 0.4:
                enrolment.note(lab.places, name, f"note {chance.randrange(99)}")
            if chance.random() < 0.4:
                enrolment.waive(lab.places, name, 2, f"was ill {chance.randrange(99)} days", TODAY)
        gone = chance.choice(sorted(read(lab.places).participants)[1:])
        keep = chance.random() < 0.5
        enrolment.exclude(lab.places, gone, "moved away", TODAY, keep_slot=keep)


@pytest.mark.slow
def test_three_laboratories_merged_in_every_order_give_one_register_and_equal_tables(
    sites: dict[str, Lab], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    unsettle(sites, random.Random(79))
    registers = [written(lab) for lab in sites.values()]
    people = {name: entry for one in registers for name, entry in one["participants"].items()}
    deviations = sorted(
        (name, d.what, d.session, d.trial, d.detail)
        for lab in sites.values()
        for name, d in all_deviations(lab.places)
    )
    assert {what for _, what, *_ in deviations} >= {"skipped", "trial repeated", "window waived"}
    recorded = {n: sha for lab in sites.values() for n, sha in recordings(lab.places.root).items()}
    tables = []
    for at, order in enumerate(permutations(SITES)):
        folder = tmp_path / str(at)
        shutil.copytree(tmp_path / "sites", folder)
        first, second, third = (folder / site for site in order)
        if at % 2:  # two of them are merged before the third takes both
            assert main(["merge", str(second), str(third)]) == 0
            assert main(["merge", str(first), str(second / "data")]) == 0
        else:
            assert main(["merge", str(first), str(second)]) == 0
            assert main(["merge", str(first), str(third)]) == 0
        merged = lab_in(first)
        assert written(merged)["participants"] == people
        assert list(written(merged)["participants"]) == sorted(people)
        assert recordings(merged.places.root) == recorded
        assert deviations == sorted(
            (name, d.what, d.session, d.trial, d.detail)
            for name, d in all_deviations(merged.places)
        )
        out = folder / "tables"
        capsys.readouterr()
        assert main(["export", str(first), "--to", "tables", "--out", str(out)]) == 0
        said = capsys.readouterr().out
        assert said.count("excluded") == 3
        assert "not in the register" not in said
        tables.append({path.name: path.read_bytes() for path in out.rglob("*.csv")})
    assert b"P101" in tables[0]["trials.csv"]
    assert all(each == tables[0] for each in tables)


def test_two_people_with_one_slot_keep_it_and_this_is_said(
    sites: dict[str, Lab], capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = sites["hamburg"], sites["dortmund"]
    before = {**written(first)["participants"], **written(second)["participants"]}
    assert main(["merge", str(first.folder), str(second.folder)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "taken from there: P201, P202, P203, P204" in said
    assert "slot 2: P102 and P202 keep it" in said
    assert "dortmund/data is unchanged" in said.replace("\\", "/")
    assert {name: (e.slot, e.group) for name, e in read(first.places).participants.items()} == {
        name: (entry["slot"], entry["group"]) for name, entry in before.items()
    }
    first.consent("P301")  # goes on, in a slot of its own
    assert list(read(first.places).holders()[5]) == ["P301"]
    places = {(each.what, each.where) for each in inventory(first.places, "P201")}
    assert ("merged from", str(second.places.root.resolve())) in places


def test_a_second_merge_is_harmless_whatever_was_changed_here_since(
    sites: dict[str, Lab], capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = sites["hamburg"], sites["dortmund"]
    join(first, second)
    enrolment.note(first.places, "P202", "left-handed")
    unfinished.correct(first.places, "P203", "P299", "wrong number", TODAY)
    before = files(first.places.root)
    assert main(["merge", str(first.folder), str(second.folder)]) == 0
    assert "nothing new in the register of" in capsys.readouterr().out
    assert files(first.places.root) == before


def other_study(first: Lab, second: Lab) -> str:
    with changed(second.places) as register:
        register.study = "welding"
    return "it is of study 'welding', this one of"


def other_lock(first: Lab, second: Lab) -> str:
    with changed(second.places) as register:
        register.participants["P201"].sessions[0].lock = "0123456789abcdef"
    return "P201, session 1 of .* was run under lock 0123456789ab, which is not the study's lock"


def one_pseudonym_twice(first: Lab, second: Lab) -> str:
    first.consent("P202")
    return "P202 is in both registers with different content: slot"


def almost_one_pseudonym(first: Lab, second: Lab) -> str:
    with changed(second.places) as register:
        register.participants["p101"] = register.participants.pop("P203")
    return "participant p101 could be taken for P101"


def erased_there(first: Lab, second: Lab) -> str:
    second.consent("P103")
    unfinished.erase(second.places, "P103", "withdrew", TODAY)
    return "P103 was erased there and not here; erase P103 here first"


def erased_here(first: Lab, second: Lab) -> str:
    first.consent("P204")
    unfinished.erase(first.places, "P204", "withdrew", TODAY)
    return "P204 was erased here and not there; erase P204 there, too"


def other_recordings(first: Lab, second: Lab) -> str:
    shutil.copytree(second.places.raw("P201"), first.places.raw("P201"))
    with (first.places.raw("P201") / "ses-01_run.xdf").open("ab") as file:
        file.write(b"x")
    return r"P201 has other recordings here: ses-01_run\.xdf$"


def still_running(first: Lab, second: Lab) -> str:
    (second.places.raw("P201") / "P201.h5").unlink()
    return "P201, session 1 is running there, or was stopped: labcrane resume"


def not_registered_there(first: Lab, second: Lab) -> str:
    shutil.copytree(second.places.raw("P201"), second.places.raw("P777"))
    return "P777 has recordings there, but is not in the register there"


def a_link(first: Lab, second: Lab) -> str:
    path = second.places.raw("P201") / "P201.h5"
    path.rename(second.folder / "P201.h5")
    path.symlink_to(second.folder / "P201.h5")
    return r"P201\.h5 is a link, and links are never followed"


def relabelled_here(first: Lab, second: Lab) -> str:
    join(first, second)
    unfinished.correct(first.places, "P203", "P299", "wrong number", TODAY)
    second.consent("P205")
    return "P203 was merged before and relabelled here; relabel there, too"


def relabelled_there(first: Lab, second: Lab) -> str:
    join(first, second)
    unfinished.correct(second.places, "P201", "P299", "wrong number", TODAY)
    return "P201 was relabelled P299 there and not here; relabel it here first"


def relabelled_there_and_copied_here(first: Lab, second: Lab) -> str:
    shutil.copytree(second.places.raw("P201"), first.places.raw("P201"))
    unfinished.correct(second.places, "P201", "P299", "wrong number", TODAY)
    return "P201 was relabelled P299 there and not here; relabel it here first"


def erased_there_and_copied_here(first: Lab, second: Lab) -> str:
    shutil.copytree(second.places.raw("P201"), first.places.raw("P201"))
    unfinished.erase(second.places, "P201", "withdrew", TODAY)
    return "P201 was erased there and not here; erase P201 here first"


def half_copied(first: Lab, second: Lab) -> str:
    shutil.rmtree(second.places.raw("P201"))
    return "P201, session 1 is in the register there and not recorded there; put its recordings"


def two_people_of_one_day(first: Lab, second: Lab) -> str:
    for lab in (first, second):
        with changed(lab.places) as register:
            register.participants["P301"] = (
                register.participants["P102"].model_copy(update={"slot": 9})
                if lab is first
                else read(first.places).participants["P301"]
            )
    return "P301 is in both registers, and no recording shows that it is one person"


FAULTS = (
    other_lock, one_pseudonym_twice, almost_one_pseudonym, erased_there, erased_here,
    other_recordings, still_running, not_registered_there, a_link,
)  # fmt: skip


def check_refused(first: Lab, second: Lab, said: list[str]) -> None:
    def content() -> list[dict[str, str]]:
        both = [files(lab.folder) for lab in (first, second)]
        return [{n: s for n, s in one.items() if not n.endswith(".lock")} for one in both]

    before = content()
    for line in said:
        with pytest.raises(ProtocolError, match=f"(?m)^  .*{line}"):
            join(first, second)
    assert content() == before


@pytest.mark.parametrize(
    "fault",
    [
        other_study,
        relabelled_here,
        relabelled_there,
        relabelled_there_and_copied_here,
        erased_there_and_copied_here,
        half_copied,
        two_people_of_one_day,
        *FAULTS,
    ],
    ids=lambda fault: fault.__name__,
)
def test_what_contradicts_is_refused_by_name_and_changes_nothing(
    sites: dict[str, Lab], fault
) -> None:
    first, second = sites["hamburg"], sites["dortmund"]
    check_refused(first, second, [fault(first, second)])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_every_one_of_several_contradictions_is_named(sites: dict[str, Lab], seed: int) -> None:
    first, second = sites["hamburg"], sites["dortmund"]
    chance = random.Random(seed)
    of_files = chance.choice([other_recordings, still_running, a_link])
    rest = [fault for fault in FAULTS if fault not in {other_recordings, still_running, a_link}]
    chosen = [of_files, *chance.sample(rest, 2)]
    chosen.sort(key=lambda fault: fault is not not_registered_there)  # it copies what is whole
    check_refused(first, second, [fault(first, second) for fault in chosen])


def test_a_folder_without_a_register_and_the_studys_own_folder_are_refused(
    sites: dict[str, Lab],
) -> None:
    first, second = sites["hamburg"], sites["dortmund"]
    with pytest.raises(ProtocolError, match="is the study's own data folder; give the other one"):
        join(first, first)
    shutil.rmtree(second.places.register.parent)
    with pytest.raises(RecordingError, match="has no register; give the data folder in which"):
        join(first, second)


def test_without_a_lock_only_people_under_the_locks_that_were_used_here_are_taken(
    sites: dict[str, Lab], tmp_path: Path
) -> None:
    first, second, third = (sites[site].places for site in SITES)
    said = other_lock(sites["hamburg"], sites["dortmund"])
    empty = Places(tmp_path / "empty")
    unfinished.join(empty, first, TODAY, None)
    unfinished.join(empty, third, TODAY, None)
    with pytest.raises(ProtocolError, match=said):
        unfinished.join(empty, second, TODAY, None)
    assert {*read(empty).participants} == {*read(first).participants, *read(third).participants}


def test_recordings_that_were_copied_by_hand_before_are_entered(sites: dict[str, Lab]) -> None:
    first, second = sites["hamburg"], sites["dortmund"]
    shutil.copytree(second.places.raw("P201"), first.places.raw("P201"))
    assert "not in the register" in {d.what for _, d in all_deviations(first.places)}
    join(first, second)
    assert "not in the register" not in {d.what for _, d in all_deviations(first.places)}


@pytest.mark.slow
@needs("fork")
def test_a_merge_that_is_killed_before_any_of_its_writes_loses_nothing_and_is_completed(
    sites: dict[str, Lab], tmp_path: Path
) -> None:
    join(sites["dortmund"], sites["aachen"])  # two people with recordings are taken
    whole = tmp_path / "whole"
    shutil.copytree(tmp_path / "sites", whole)
    join(lab_in(whole / "hamburg"), lab_in(whole / "dortmund"))
    wanted = {
        name: sha for name, sha in files(whole / "hamburg").items() if "register/" not in name
    }
    people = written(lab_in(whole / "hamburg"))["participants"]
    own = {
        name: sha for name, sha in files(sites["hamburg"].folder).items() if "register/" not in name
    }
    number, chance = 1, random.Random(79)
    while True:
        folder = tmp_path / f"killed{number}"
        shutil.copytree(tmp_path / "sites", folder)
        first, second = lab_in(folder / "hamburg"), lab_in(folder / "dortmund")
        there = files(second.folder)
        was_killed = killed_at(number, lambda a=first, b=second: join(a, b))
        left = {n: sha for n, sha in files(first.folder).items() if "/P" in n and "/." not in n}
        assert own.items() <= files(first.folder).items()
        assert left.items() <= wanted.items()
        entered = written(first)["participants"]
        assert entered == people or set(entered) == {"P101", "P102", "P103"}
        assert left == {n: s for n, s in wanted.items() if "/P" in n} or entered != people
        killed_at(chance.randint(1, number), lambda a=first, b=second: join(a, b))  # and again
        for _ in range(2):
            join(first, second)
            assert recordings(first.folder) == wanted
            assert written(first)["participants"] == people
            assert len(written(first)["merges"]) == 2
        assert files(second.folder) == there
        shutil.rmtree(folder)
        if not was_killed:
            break
        number += 1
    assert number > 20


def test_laboratories_are_merged_into_a_copy_of_the_study_without_data_as_often_as_wanted(
    sites: dict[str, Lab], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for day in ("monday", "tuesday"):
        together = tmp_path / day
        shutil.copytree(sites["aachen"].folder, together, ignore=shutil.ignore_patterns("data"))
        for lab in sites.values():
            assert main(["merge", str(together), str(lab.folder)]) == 0
        people = read(lab_in(together).places).participants
        assert people == {
            name: entry
            for lab in sites.values()
            for name, entry in read(lab.places).participants.items()
        }
        sites["aachen"].consent("P399")  # the laboratories go on
        enrolment.note(sites["dortmund"].places, "P201", "left-handed")
    capsys.readouterr()
    assert main(["erase", str(together), "P201", "--reason", "withdrew", "--yes"]) == 0
    assert not (together / "data" / "P201").exists()
    assert main(["where", str(together), "P201"]) == 0
    assert "merged from" in capsys.readouterr().out


def test_caches_of_one_laboratory_are_no_recordings(sites: dict[str, Lab]) -> None:
    """After an export in one of them the next merge was refused."""
    first, second = sites["hamburg"], sites["dortmund"]
    join(first, second)
    for lab, name in ((first, "a"), (second, "b")):
        cache = lab.places.raw("P201") / ".measures"
        cache.mkdir(exist_ok=True)
        (cache / f"{name}.parquet").write_bytes(b"x")
    second.consent("P205")
    assert join(first, second).taken == ["P205"]


def test_another_study_is_not_taken_into_an_empty_copy(
    sites: dict[str, Lab], capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = sites["hamburg"], sites["dortmund"]
    shutil.rmtree(first.places.root)
    with changed(second.places) as register:
        register.study = "welding"
        for entry in register.participants.values():
            entry.sessions.clear()
    shutil.rmtree(second.places.raw("P201"))
    assert main(["merge", str(first.folder), str(second.folder)]) == 2
    assert "it is of study 'welding', this one of 'rehearsal'" in capsys.readouterr().err


def test_recordings_of_somebody_erased_are_named(sites: dict[str, Lab]) -> None:
    lab = sites["dortmund"]
    kept = shutil.copytree(lab.places.raw("P201"), lab.folder / "P201")
    unfinished.erase(lab.places, "P201", "withdrew", TODAY)
    assert "P201" not in dict(all_deviations(lab.places))
    shutil.copytree(kept, lab.places.raw("P201"))
    assert dict(all_deviations(lab.places))["P201"].what
    assert ("P201", "erased") in {(name, each.what) for name, each in all_deviations(lab.places)}
