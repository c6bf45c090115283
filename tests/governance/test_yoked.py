"""Yoked participants: who is chosen, what is copied, and what erasing and relabelling reach."""

import multiprocessing
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from governance.kept_people import killed_at, lab_in
from governed import PERSON, TODAY, Lab, Willing
from once import made_once
from session.test_estimates import SHARE, Scripted, text

from labcrane import ProtocolError, RecordingError, open_recording
from labcrane.analysis import Participant
from labcrane.analysis.cohort import Status
from labcrane.analysis.quality import estimates_quality
from labcrane.approval.codebook import codebook
from labcrane.approval.methods import methods
from labcrane.design.slots import group_of, slots_before
from labcrane.errors import StorageError
from labcrane.files.lock import held
from labcrane.participants import enrolment
from labcrane.participants import recovery as unfinished
from labcrane.participants.copies import inventory
from labcrane.participants.register import read
from labcrane.participants.yoking import others_values, yoke
from labcrane.protocol import estimated, rig
from labcrane.protocol.estimated import WithEstimates
from labcrane.recording.journal_reader import read_journal
from labcrane.recording.participant_file.recover import is_recovered
from labcrane.replay import replay_session
from labcrane.testing import Command, Order, main, run

VALUES = ("estimate.load.ratio", "estimate.load.time")
STUDY = (
    text(SHARE)
    .replace("{use: dual_joystick}", PERSON)
    .replace("{ratio: 2}", "{ratio: 2}, yoked: [b]")
    .replace("sessions:", "design: {groups: {a: [], b: []}}\nsessions:")
)


@pytest.fixture(autouse=True)
def scripted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(estimated, "Received", Scripted)
    monkeypatch.setattr(rig, "WithEstimates", lambda *of: WithEstimates(*of[:2], "any", *of[3:]))


def people(lab: Lab) -> tuple[list[str], list[str]]:
    """Return the participants with values of their own, and the yoked ones, in order."""
    entries = read(lab.places).participants.items()
    return tuple([name for name, each in entries if each.group == group] for group in "ab")


def choices(lab: Lab) -> dict[str, str]:
    return {each.participant: each.source for each in read(lab.places).yokes}


def session(lab: Lab, name: str):
    return open_recording(lab.places.raw(name) / f"{name}.h5").session(1)


def _record(folder: Path) -> None:
    """Approve, enrol six, and record two with values of their own and then a yoked one."""
    lab = Lab(folder, STUDY)
    lab.approve()
    for number in range(1, 7):
        lab.consent(f"P{number:03}")
    own, yoked = people(lab)
    for name in (*own[:2], yoked[0]):
        lab.run(name)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(estimated, "Received", Scripted)
        patch.setattr(rig, "WithEstimates", lambda *of: WithEstimates(*of[:2], "any", *of[3:]))
        yield made_once("yoked", _record, tmp_path_factory.mktemp("yoked"))


@pytest.fixture
def lab(recorded: Path, tmp_path: Path) -> Lab:
    shutil.copytree(recorded, tmp_path / "lab")
    return lab_in(tmp_path / "lab")


@pytest.mark.slow
def test_a_yoked_session_has_the_others_values_tick_by_tick_and_replays_to_the_bit(
    lab: Lab,
) -> None:
    own, yoked = people(lab)
    assert choices(lab) == {yoked[0]: own[0]}
    loops, inputs = (
        [session(lab, who).streams[stream].data for who in (own[0], yoked[0])]
        for stream in ("loop", "input")
    )
    used = set()
    for trial in range(1, 4):
        one, other = (
            frames[loop["trial"] == trial][["estimate.load.ratio", "estimate.load.state"]]
            for frames, loop in zip(inputs, loops, strict=True)
        )
        size = min(len(one), len(other))
        assert size > 100
        assert np.array_equal(one[:size], other[:size])
        used |= {*one["estimate.load.ratio"]}
    assert used == {2.0, 3.0}
    path = lab.places.raw(yoked[0]) / f"{yoked[0]}.h5"
    assert session(lab, yoked[0]).context["yoked_to"] == own[0]
    assert replay_session(path, 1, run_code=True).difference is None
    (row,) = estimates_quality(Participant("P", path, Status.COMPLETE, "")).to_dict("records")
    assert row["values_of"] == own[0]


@pytest.mark.slow
def test_the_choice_is_in_the_register_before_the_session_and_stays(lab: Lab) -> None:
    own, yoked = people(lab)
    found = admitted(lab, yoked[1])
    assert choices(lab)[yoked[1]] == own[1], "the first has a participant of this group"
    lab.run(own[2])
    assert admitted(lab, yoked[1]) == found == {"yoked_to": own[1], "yoked": ["load"]}
    enrolment.exclude(lab.places, own[1], "moved", TODAY)
    assert admitted(lab, yoked[1])["yoked_to"] == own[2], "the session has not begun"


def admitted(lab: Lab, name: str) -> dict:
    visit = lab.visit(name)
    return yoke(visit.study, visit.folder, 1, read(lab.places).participants[name].slot)


@pytest.mark.slow
def test_two_processes_at_once_never_get_one_source(lab: Lab) -> None:
    own, yoked = people(lab)
    lab.run(own[2])
    fork = multiprocessing.get_context("fork")
    racing = [fork.Process(target=admitted, args=(lab, name)) for name in yoked[1:]]
    for process in racing:
        process.start()
    for process in racing:
        process.join()
    assert [process.exitcode for process in racing] == [0, 0]
    assert sorted(choices(lab).values()) == sorted(own[:3])


@pytest.mark.slow
def test_the_refusal_is_worded_alike_for_both_groups_and_names_no_other(tmp_path: Path) -> None:
    lab = Lab(tmp_path, STUDY)
    lab.approve()
    for number in range(1, 9):
        lab.consent(f"P{number:03}")
    refusals, groups = set(), set()
    for name, entry in read(lab.places).participants.items():
        before = slots_before("adaptive", ("a", "b"), ["b"], entry.slot)
        if not before:
            continue
        groups.add(entry.group)
        with pytest.raises(ProtocolError) as refused:
            lab.run(name)
        refusals.add(str(refused.value).replace(name, "X"))
        assert not (lab.places.raw(name)).exists()
    assert groups == {"a", "b"}
    assert refusals == {
        "session 1 of X cannot be run yet: it comes after those of other participants; labcrane "
        "plan shows after which"
    }


@pytest.mark.parametrize("groups", [("a", "b"), ("a", "b", "c"), ("b", "c", "a", "d")])
def test_whoever_comes_after_the_slots_before_finds_a_source(groups: tuple[str, ...]) -> None:
    yoked = {"b", "c"} & {*groups}
    for slot in range(1, 40):
        before = slots_before("study", groups, yoked, slot)
        in_group = dict.fromkeys(yoked, 0)
        for each in range(1, slot + 1):
            if (name := group_of("study", groups, each)) in yoked:
                in_group[name] += 1
        assert {group_of("study", groups, each) for each in before}.isdisjoint(yoked)
        if group_of("study", groups, slot) in yoked or before:
            assert len(before) == max(in_group.values())
    assert {
        group_of("study", groups, each) in yoked
        for each in range(1, 40)
        if slots_before("study", groups, yoked, each)
    } == {True, False}


@pytest.mark.slow
def test_erasing_the_source_empties_its_values_wherever_they_were_copied(
    lab: Lab, tmp_path: Path
) -> None:
    own, yoked = people(lab)
    source, other = own[0], yoked[0]
    before = session(lab, other)
    kept = before.streams["state"].data
    share = before.streams["command"].data["assist.share"]
    states = before.streams["input"].data["estimate.load.state"]
    store = tmp_path / "store"
    store.mkdir()
    unfinished.move(lab.places, store)
    out = lab.places.exports / "tables"
    assert main(["export", str(lab.places.root), "--to", "tables", "--out", str(out)]) == 0
    assert left_in(out, other)
    (lab.places.raw(other) / ".measures").mkdir(exist_ok=True)
    assert str(lab.places.raw(other)) in {each.where for each in inventory(lab.places, source)}
    erased = unfinished.erase(lab.places, source, "withdrew consent", TODAY)
    assert not erased.mentions
    folder = lab.places.raw(other)
    after = session(lab, other)
    assert after.streams["input"].data[[*VALUES]].isna().all(axis=None)
    assert after.streams["input"].data["estimate.load.state"].equals(states)
    assert after.streams["state"].data.equals(kept)
    assert after.streams["command"].data["assist.share"].equals(share)
    assert after.trials["load_ratio"].isna().all()
    assert after.context["yoked_to"] == "erased"
    log, _ = read_journal([folder / "ses-01_run.xdf"])
    assert all(np.isnan(log.column("input", label)).all() for label in VALUES)
    assert is_recovered(folder, 1)
    assert not (folder / ".measures").exists(), "made of the values"
    assert left_in(out, other) == [], "to be exported again"
    with np.load(folder / "ses-01_estimates.npz") as copied:
        assert copied.files == []
    for root in (lab.places.root, store):
        for path in root.rglob("*"):
            if path.is_file() and path != lab.places.register:
                assert source.encode() not in path.read_bytes(), path
    assert not (store / "adaptive" / other).exists(), "to be transferred again"
    assert f"transfer to {store}" in erased.reach.again
    assert choices(lab) == {other: ""}
    with pytest.raises(RecordingError, match="cannot be replayed: the values of estimates were"):
        replay_session(folder / f"{other}.h5", 1, run_code=True)
    (row,) = estimates_quality(
        Participant("P", folder / f"{other}.h5", Status.COMPLETE, "")
    ).to_dict("records")
    assert row["values_of"] == "erased"
    assert session(lab, own[1]).streams["input"].data[[*VALUES]].notna().any(axis=None)


def left_in(folder: Path, name: str) -> list[str]:
    """Return the lines of exported tables with a participant."""
    tables = [*folder.rglob("*.csv"), *folder.rglob("*.tsv")]
    lines = (line for table in tables for line in table.read_text("utf-8").splitlines())
    return [line for line in lines if name in line]


@pytest.mark.slow
def test_relabelling_the_source_changes_its_name_in_register_and_files(lab: Lab) -> None:
    own, yoked = people(lab)
    before = session(lab, yoked[0])
    values = before.streams["input"].data
    unfinished.correct(lab.places, own[0], "P077", "typed wrongly", TODAY)
    assert choices(lab) == {yoked[0]: "P077"}
    after = session(lab, yoked[0])
    assert after.context == {**before.context, "yoked_to": "P077"}
    assert after.attrs["yoked_to"] == "P077"
    assert after.streams["input"].data.equals(values)
    log, _ = read_journal([lab.places.raw(yoked[0]) / "ses-01_run.xdf"])
    assert log.context["yoked_to"] == "P077"
    assert is_recovered(lab.places.raw(yoked[0]), 1)
    unfinished.correct(lab.places, yoked[0], "P078", "typed wrongly", TODAY)
    assert choices(lab) == {"P078": "P077"}
    unfinished.erase(lab.places, "P078", "withdrew consent", TODAY)
    assert choices(lab) == {}


@pytest.mark.slow
def test_a_stopped_session_goes_on_without_the_source_s_folder(lab: Lab) -> None:
    own, yoked = people(lab)
    name = yoked[1]
    path = run(lab.visit(name, fast=True), Willing({400: [Command(Order.END)]}))
    source = choices(lab)[name]
    assert source == own[1]
    unfinished_visit = lab.visit(name, fast=True, resumed=True, policy="redo_trial")
    away = lab.folder / "away"
    lab.places.raw(source).rename(away)
    (lab.folder / "before").mkdir()
    shutil.copytree(lab.places.root, lab.folder / "before" / "data")
    run(unfinished_visit, Willing())
    resumed = open_recording(path).session(1)
    used = resumed.streams["input"].data
    assert set(resumed.trials["outcome"].tail(1)) == {"success"}
    assert 3.0 in set(used["estimate.load.ratio"][resumed.streams["loop"].data["trial"] == 3])
    starts = resumed.events[resumed.events["name"] == "session.start"]["data"].tolist()
    assert [each["yoked_to"] for each in starts] == 2 * [source]


@pytest.mark.slow
def test_a_stopped_session_goes_on_with_the_fallback_after_its_source_was_erased(lab: Lab) -> None:
    _, yoked = people(lab)
    path = run(lab.visit(yoked[1], fast=True), Willing({400: [Command(Order.END)]}))
    unfinished.erase(lab.places, choices(lab)[yoked[1]], "withdrew consent", TODAY)
    run(lab.visit(yoked[1], fast=True, resumed=True, policy="redo_trial"), Willing())
    resumed = open_recording(path).session(1)
    later = resumed.streams["input"].data[resumed.streams["loop"].data["trial"] == 3]
    assert set(later["estimate.load.ratio"].tail(100)) == {2.0}, "the fallback"
    assert resumed.context["yoked_to"] == "erased"


@pytest.mark.slow
def test_a_source_is_not_erased_while_a_session_that_is_yoked_to_it_runs(lab: Lab) -> None:
    own, yoked = people(lab)
    with (
        held(lab.places.raw(yoked[0]) / ".run.lock", "busy"),
        pytest.raises(StorageError, match=f"a session of {yoked[0]} is running; wait"),
    ):
        unfinished.erase(lab.places, own[0], "withdrew consent", TODAY)
    assert read(lab.places).work is None
    assert lab.places.raw(own[0]).is_dir()


@pytest.mark.slow
def test_a_damaged_or_older_recording_is_not_chosen(lab: Lab) -> None:
    own, yoked = people(lab)
    (lab.places.raw(own[1]) / f"{own[1]}.h5").write_bytes(b"x" * 5000)
    with pytest.raises(ProtocolError, match="comes after those of other participants"):
        admitted(lab, yoked[1])


@pytest.mark.slow
def test_a_merge_takes_the_choices_and_refuses_two_for_one_session(
    lab: Lab, tmp_path: Path
) -> None:
    empty = Lab(tmp_path / "whole" if (tmp_path / "whole").mkdir() is None else tmp_path, STUDY)
    known = choices(lab)
    done = unfinished.join(empty.places, lab.places, TODAY, None, "adaptive")
    assert len(done.taken) == 6
    assert choices(empty) == known
    own, yoked = people(lab)
    changed = empty.places.register.read_text(encoding="utf-8")
    changed = re.sub(f'"source": "{own[0]}"', f'"source": "{own[1]}"', changed)
    changed = re.sub(r'"register_sha256": "\w+"', '"register_sha256": "other"', changed)
    empty.places.register.write_text(changed, encoding="utf-8")
    with pytest.raises(ProtocolError, match=f"{yoked[0]} is in both .* different content: yokes"):
        unfinished.join(empty.places, lab.places, TODAY, None, "adaptive")


def test_the_values_of_a_session_without_its_copy_are_asked_for(tmp_path: Path) -> None:
    lab = Lab(tmp_path, STUDY)
    visit = lab.visit("P001")
    with pytest.raises(RecordingError, match=r"the session needs it: .*; restore it from a backup"):
        others_values(visit.study, visit.folder, 1, {"yoked_to": "P002", "yoked": ["load"]})


@pytest.mark.slow
def test_an_erasure_that_is_killed_anywhere_is_finished_by_the_next_call(
    lab: Lab, tmp_path: Path
) -> None:
    own, yoked = people(lab)
    number, was_killed = 1, True
    while was_killed:
        now = lab_in(Path(shutil.copytree(lab.folder, tmp_path / str(number))))
        was_killed = killed_at(
            number, lambda now=now: unfinished.erase(now.places, own[0], "withdrew", TODAY)
        )
        if was_killed and own[0] in read(now.places).names() and not read(now.places).tombstones:
            unfinished.erase(now.places, own[0], "withdrew", TODAY)
        after = session(now, yoked[0])
        assert after.streams["input"].data[[*VALUES]].isna().all(axis=None)
        assert after.context["yoked_to"] == "erased"
        assert is_recovered(now.places.raw(yoked[0]), 1)
        assert not (now.places.raw(yoked[0]) / ".rewritten").exists()
        assert choices(now) == {yoked[0]: ""}
        shutil.rmtree(now.folder)
        number += 5
    assert number > 15


def test_the_plan_the_methods_and_the_codebook_name_the_yoking(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lab = Lab(tmp_path, STUDY)
    assert main(["plan", str(lab.protocol), "--participants", "4"]) == 0
    planned = capsys.readouterr().out
    for slot in range(1, 5):
        (line,) = re.findall(rf"slot {slot}, .*", planned)
        before = ", ".join(map(str, slots_before("adaptive", ("a", "b"), ["b"], slot)))
        assert line.endswith(f", after session 1 of slots {before}") == bool(before)
    (column,) = (each for each in codebook(lab.study) if each.name == "estimate.load.ratio")
    assert column.definition.endswith(
        "in yoked groups (b) as another participant's session used it"
    )
    said = methods(lab.approve())
    assert "In b they were yoked: instead of their own values of the estimate load" in said
