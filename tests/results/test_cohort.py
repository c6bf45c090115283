"""Who counts, and who is listed instead."""

import shutil
from pathlib import Path

import pytest

from labcrane import ProtocolError, RecordingError
from labcrane.analysis import find_cohort
from labcrane.analysis.cohort import Cohort, Status
from labcrane.testing import main
from results.recorded import STUDY, record, study


def test_complete_participants_are_included_and_everybody_else_is_listed_with_a_reason(
    cohort: Cohort,
) -> None:
    assert [person.name for person in cohort.included] == ["P001", "P002"]
    listing = cohort.listing().set_index("participant")
    assert listing["status"].to_dict() == {
        "P001": "complete",
        "P001-PILOT": "pilot",
        "P002": "complete",
        "P003": "half-finished",
        "P005-SIMULATED": "simulated",
        "P006": "erased",
        "P007": "unreadable",
    }
    assert listing.loc["P003", "why"] == (
        "session 1 ended by order; to continue it, run labcrane resume --participant P003"
    )
    assert listing.loc["P001-PILOT", "why"] == "session 1 is stamped pilot"
    assert "labcrane recover" in listing.loc["P007", "why"]
    assert set(listing.loc[["P003", "P006"], "included"]) == {"no"}


@pytest.mark.parametrize("name", ["P004", "P001-PILOT", "P00l", "Copy of P001"])
def test_a_copy_under_another_name_is_left_out_and_named(
    data: Path, tmp_path: Path, name: str
) -> None:
    """It counted as a second person, though the file says whose it is."""
    shutil.copytree(data / "P001", tmp_path / "data" / "P001")
    shutil.copytree(data / "P002", tmp_path / "data" / "P002")
    shutil.copytree(data / "P001", tmp_path / "data" / name)
    (tmp_path / "data" / name / "P001.h5").rename(tmp_path / "data" / name / f"{name}.h5")
    found = find_cohort(tmp_path / "data")
    assert [person.name for person in found.included] == ["P001", "P002"]
    (copy,) = found.unreadable
    assert copy.name == name
    assert copy.why == (
        "says that it is of P001: a copy, or in the wrong folder; remove it, or name its "
        "folder P001"
    )


@pytest.mark.parametrize("whose", ["P001", "another study's"])
def test_a_session_of_somebody_else_in_a_folder_is_left_out_and_named(
    data: Path, tmp_path: Path, whose: str
) -> None:
    """Only the file's first session was asked: a second one of another person counted twice."""
    for name in ("P001", "P002"):
        shutil.copytree(data / name, tmp_path / "data" / name)
    source = data / "P001"
    if whose != "P001":
        other = tmp_path / "other"
        other.mkdir()
        text = STUDY.replace("study: ", "study: another_", 1)
        record(study(other, text), other / "data", "P002")
        source = other / "data" / "P002"
    for path in source.glob("ses-01*"):
        name = path.name.replace("ses-01", "ses-02")
        shutil.copyfile(path, tmp_path / "data" / "P002" / name)
    assert main(["recover", str(tmp_path / "data" / "P002")]) == 0
    found = find_cohort(tmp_path / "data")
    assert [person.name for person in found.included] == ["P001"]
    (stranger,) = found.unreadable
    if whose == "P001":
        assert stranger.why == "session 2 says that it is of P001: take it out"
    else:
        assert "its sessions are of 2 studies, session 1 of" in stranger.why


def test_a_session_that_was_killed_at_its_start_makes_no_study_of_its_own(
    data: Path, tmp_path: Path
) -> None:
    for name in ("P001", "P002"):
        shutil.copytree(data / name, tmp_path / "data" / name)
    here = tmp_path / "data" / "P002"
    (here / "P002.h5").unlink()
    for path in [*here.glob("ses-01*")]:
        path.rename(here / path.name.replace("ses-01", "ses-02"))
    (here / "ses-01_run.xdf").write_bytes(b"XDF:")
    assert main(["recover", str(here)]) == 0
    listed = find_cohort(tmp_path / "data", ["half-finished"]).listing()
    assert "studies" not in " ".join(listed["why"])
    assert set(listed["participant"]) == {"P001", "P002"}


def test_people_of_two_studies_are_not_pooled(data: Path, tmp_path: Path) -> None:
    shutil.copytree(data / "P001", tmp_path / "data" / "P001")
    other = tmp_path / "other"
    other.mkdir()
    record(study(other, STUDY.replace("study: ", "study: another_", 1)), tmp_path / "data", "P002")
    with pytest.raises(RecordingError) as refused:
        find_cohort(tmp_path / "data")
    assert "holds recordings of 2 studies" in str(refused.value)
    assert "(as of P001) and 'another_" in str(refused.value)
    assert "give each study a data folder of its own" in str(refused.value)


def test_others_are_included_by_their_status(data: Path) -> None:
    found = find_cohort(data, ["half-finished", "simulated"])
    names = [person.name for person in found.included]
    assert names == ["P001", "P002", "P003", "P005-SIMULATED"]


@pytest.mark.parametrize("status", ["erased", "unreadable", "everybody"])
def test_what_cannot_be_included_is_refused(data: Path, status: str) -> None:
    with pytest.raises(ProtocolError) as refusal:
        find_cohort(data, [status])
    assert str(refusal.value) == (
        f"{status!r} cannot be included; possible: simulated, pilot, half-finished "
        "(complete participants always are, erased, excluded and unreadable ones never)"
    )


def test_a_folder_without_anybody_to_use_says_what_is_in_it(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="there is no participant in"):
        find_cohort(tmp_path)
    with pytest.raises(RecordingError, match=r"there is no data folder .*; give the study's"):
        find_cohort(tmp_path / "nowhere")
    (tmp_path / "P001").mkdir()
    (tmp_path / "P001" / "P001.h5").touch()
    with pytest.raises(RecordingError) as refused:
        find_cohort(tmp_path / "P001.h5")
    assert str(refused.value) == (
        f"there is no data folder {tmp_path / 'P001.h5'}; give the study's data folder, "
        f"{tmp_path}, which holds {tmp_path / 'P001' / 'P001.h5'}"
    )
    shutil.rmtree(tmp_path / "P001")
    erased = {"P001": (Status.ERASED, "on 2026-05-01: withdrew")}
    with pytest.raises(RecordingError, match=r"no usable participant in .*: 1 erased$"):
        find_cohort(tmp_path, struck=erased)


def test_the_folder_of_one_recording_is_told_from_a_study(data: Path) -> None:
    with pytest.raises(RecordingError) as told:
        find_cohort(data / "P001")
    assert str(told.value) == (
        f"{data / 'P001'} is not a study's data folder but contains one recording, P001.h5; give "
        "the folder above it, or read what was recorded without a study with "
        "labcrane.open_recording, or its ses-*_streams.xdf with any reader of XDF"
    )


@pytest.mark.parametrize(
    "words",
    [
        ("report", "{}"), ("score", "{}"), ("export", "{}", "--to", "tables", "--out", "new"),
        ("participants", "--data", "{}"), ("where", "P001", "--data", "{}"),
        ("transfer", "store", "--data", "{}"),
        ("erase", "P001", "--reason", "left", "--data", "{}"),
        ("exclude", "P001", "--reason", "left", "--data", "{}"),
    ],
)  # fmt: skip
def test_a_file_given_as_data_folder_is_refused(
    data: Path, words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    path = data / "P001" / "P001.h5"
    assert main([word.format(path) for word in words]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert said == f"labcrane: {path} is a file; give the folder that holds the study's data"


def test_nobody_to_use_names_what_would_help(data: Path, tmp_path: Path) -> None:
    shutil.copytree(data / "P007", tmp_path / "P007")
    with pytest.raises(
        RecordingError,
        match=r"resume --participant P007 continues it.*labcrane recover .*P007 builds",
    ) as refused:
        find_cohort(tmp_path)
    assert "--include" not in str(refused.value)
    shutil.copytree(data / "P003", tmp_path / "P003")
    with pytest.raises(RecordingError, match=r"recover .*resume .*: --include half-finished$"):
        find_cohort(tmp_path)


def test_a_file_that_is_older_than_its_journals_is_left_out_and_named(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("P001", "P002"):
        shutil.copytree(data / name, tmp_path / name)
    folder = tmp_path / "P001"
    first = folder / "ses-01_run.xdf"
    shutil.copyfile(first, folder / "ses-01_run.part2.xdf")
    why = (
        f"session 1 is only in part in {folder / 'P001.h5'}, which is older than the journals "
        f"beside it; the session is still running, or was killed: run labcrane recover {folder}"
    )
    cohort = find_cohort(tmp_path)
    assert [person.name for person in cohort.included] == ["P002"]
    assert [(one.status, one.why) for one in cohort.left_out] == [(Status.UNREADABLE, why)]
    words = ["export", str(tmp_path), "--to", "tables", "--out", str(tmp_path / "out")]
    assert main([*words, "--set", "streams=none"]) == 3
    assert f"left out: P001, unreadable: {why}" in " ".join(capsys.readouterr().out.split())


@pytest.mark.slow
def test_a_replay_of_a_file_that_is_older_than_its_journals_says_so_once(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "P002"
    shutil.copytree(data / "P002", folder)
    shutil.copyfile(folder / "ses-01_run.xdf", folder / "ses-01_run.part2.xdf")
    main(["replay", str(folder / "P002.h5")])
    assert capsys.readouterr().err.count(f"run labcrane recover {folder}") == 1


def test_external_streams_alone_are_of_a_session_that_did_not_start(tmp_path: Path) -> None:
    (tmp_path / "P001").mkdir()
    (tmp_path / "P001" / "ses-01_streams.xdf").write_bytes(b"XDF:")
    with pytest.raises(RecordingError) as refused:
        find_cohort(tmp_path)
    assert str(refused.value).endswith(
        "P001: its session did not start: only external streams are recorded; labcrane run "
        "--participant P001 begins it"
    )


def test_an_excluded_participant_is_listed_with_the_reason_and_not_used(data: Path) -> None:
    excluded = {"P002": (Status.EXCLUDED, "on 2026-05-02: fell asleep")}
    found = find_cohort(data, struck=excluded)
    assert [person.name for person in found.included] == ["P001"]
    (left_out,) = (person for person in found.left_out if person.name == "P002")
    assert (left_out.status, left_out.why) == excluded["P002"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pilot", "simulated"])
def test_an_unfinished_pilot_or_simulation_needs_both_of_its_words(
    tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    from labcrane.analysis.cohort import kinds_of
    from labcrane.testing import Command, Order

    stamps = {kind: True}
    record(study(tmp_path), tmp_path / "data", "P001", orders={0: [Command(Order.END)]}, **stamps)
    for asked in ([kind], ["half-finished"]):
        with pytest.raises(RecordingError) as refused:
            find_cohort(tmp_path / "data", asked)
        assert "1 half-finished" in str(refused.value)
        both = {f"--include {kind} --include half-finished"}
        assert str(refused.value).rpartition(": ")[2] in both
    assert main(["report", str(tmp_path / "data"), "--include", kind]) == 1
    assert "no usable participant" in capsys.readouterr().err
    cohort = find_cohort(tmp_path / "data", [kind, "half-finished"])
    option = {"pilot": "--pilot", "simulated": "--simulate"}[kind]
    assert cohort.included[0].why == (
        "session 1 ended by order; to continue it, run labcrane resume --participant P001 "
        f"{option}; session 1 is stamped {kind}"
    )
    assert kinds_of(cohort.included) == kind.upper()


@pytest.mark.slow
def test_a_session_that_is_still_to_come_makes_a_participant_half_finished(tmp_path: Path) -> None:
    second = "  - name: retention\n    steps:\n      - block: {task: aiming}\n"
    record(study(tmp_path, STUDY + second), tmp_path / "data", "P001")
    (person,) = find_cohort(tmp_path / "data", ["half-finished"]).included
    assert person.why == "1 of 2 sessions recorded"
