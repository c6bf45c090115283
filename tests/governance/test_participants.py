"""The register, consent, session windows and deviations."""

import os
import re
import shutil
import signal
import stat
from datetime import date, timedelta
from pathlib import Path

import pytest
from governance.kept_people import lab_in
from governed import GOVERNED, GROUPED, PERSON, TODAY, Lab, Willing
from needs import needs

import labcrane
from labcrane import DeviceError, ProtocolError
from labcrane.launcher import launcher
from labcrane.participants import enrolment
from labcrane.participants.deviations import all_deviations
from labcrane.participants.personal_data import personal
from labcrane.participants.register import changed, read
from labcrane.session.eligibility import check_eligibility
from labcrane.testing import Command, Order, QueueConsole, Visit, main, run

TWO_SESSIONS = GOVERNED + (
    "  - name: retention\n    after_days: [1, 3]\n    steps:\n"
    "      - block: {task: aiming, pairs: 1}\n"
)


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    lab = Lab(tmp_path)
    lab.approve()
    return lab


def test_a_participant_without_consent_is_refused(lab: Lab) -> None:
    with pytest.raises(
        ProtocolError,
        match=r"P001 has not consented to consent_v2\.txt \(version [0-9a-f]{12}\); once .* conf",
    ):
        check_eligibility(lab.visit("P001"))
    lab.consent("P001")
    assert check_eligibility(lab.visit("P001")).slot == 1


@pytest.mark.slow
def test_a_session_leaves_approval_consent_slot_and_group_in_the_file(tmp_path: Path) -> None:
    lab = Lab(tmp_path, GROUPED)
    lock = lab.approve()
    lab.run("P005")  # the first to come, whatever the number
    entry = read(lab.places).participants["P005"]
    assert entry.slot == 1
    session = labcrane.open_recording(lab.places.raw("P005") / "P005.h5").session(1)
    assert session.attrs["slot"] == 1
    assert session.attrs["group"] == entry.group
    assert set(session.trials["group"]) == {entry.group}
    assert session.attrs["approval"] == "KB-12/2026"
    assert session.attrs["lock"] == lock.seal
    assert session.attrs["consent_version"] == lock.consent_version
    assert session.attrs["consent_date"] == TODAY.isoformat()
    (sitting,) = entry.sessions
    assert (sitting.session, sitting.lock, sitting.deviations) == (1, lock.seal, [])


@pytest.mark.slow
def test_the_list_of_participants_says_which_session_is_owed(
    lab: Lab, capsys: pytest.CaptureFixture[str]
) -> None:
    def listed() -> str:
        assert main(["participants", "--data", str(lab.places.root)]) == 0
        return " ".join(capsys.readouterr().out.split())

    lab.run("P001", {60: [Command(Order.END)]})
    assert f"1 {TODAY} ended by order" in listed()
    run(lab.visit("P001", fast=True, resumed=True), Willing())
    assert f"1 {TODAY} complete" in listed()
    journal = lab.places.raw("P001") / "ses-01_run.xdf"
    added = journal.with_name("ses-01_run.part7.xdf")
    added.write_bytes(journal.read_bytes())
    assert f"1 {TODAY} complete, as far as the file goes (" in listed()
    assert f"labcrane recover {journal.parent}" in listed()
    added.unlink()
    (lab.places.raw("P001") / "P001.h5").unlink()
    assert (
        f"1 {TODAY} without participant file: still running, or was killed; labcrane resume "
        "--participant P001 continues it"
    ) in listed()
    for part in journal.parent.glob("*.xdf"):
        part.unlink()
    assert (
        f"1 {TODAY} did not start: nothing of it is recorded; labcrane run --participant P001 "
        "begins it"
    ) in listed()


def test_a_session_whose_feedback_cannot_be_started_is_not_in_the_register(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(visit: Visit) -> None:
        assert read(lab.places).participants["P001"].sessions
        raise DeviceError("feedback 'window' cannot be started: there is no display")

    monkeypatch.setattr(launcher, "FeedbackProcesses", refuse)
    lab.consent("P001")
    with pytest.raises(DeviceError, match="feedback 'window' cannot be started"):
        launcher.Launcher(lab.visit("P001", feedback=True), QueueConsole(), print).run()
    assert read(lab.places).participants["P001"].sessions == []


@pytest.mark.slow
@needs("permissions")
def test_everything_about_people_is_for_the_user_only(lab: Lab) -> None:
    lab.run("P001")
    assert stat.S_IMODE(lab.places.root.stat().st_mode) == 0o700
    found = list(lab.places.root.rglob("*"))
    assert {path.relative_to(lab.places.root).parts[0] for path in found} == {"register", "P001"}
    for path in found:
        assert stat.S_IMODE(path.stat().st_mode) == (0o700 if path.is_dir() else 0o600), path


def test_what_did_not_go_as_planned_is_listed(lab: Lab) -> None:
    orders = {40: [Command(Order.SKIP)], 60: [Command(Order.REPEAT)], 90: [Command(Order.OVERRIDE)]}
    lab.run("P001", orders | {120: [Command(Order.END)]})
    found = [(d.what, d.trial > 0) for _, d in all_deviations(lab.places)]
    assert found == [
        ("skipped", True), ("trial repeated", True), ("automatic end overridden", True),
        ("session ended early", False),
    ]  # fmt: skip
    (sitting,) = read(lab.places).participants["P001"].sessions
    assert [deviation.what for deviation in sitting.deviations] == [what for what, _ in found]


@needs("fork")
def test_the_deviations_of_a_session_that_was_killed_come_from_its_journal(lab: Lab) -> None:
    lab.consent("P001")
    child = os.fork()
    if child == 0:
        from labcrane.testing import run

        class Killer(Willing):
            def commands(self):
                if self._tick == 100:
                    os.kill(os.getpid(), signal.SIGKILL)
                return super().commands()

        try:
            run(lab.visit("P001"), Killer({50: [Command(Order.SKIP)]}))
        finally:
            os._exit(1)
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status)
    assert [d.what for _, d in all_deviations(lab.places)] == ["skipped", "session cut off"]


@pytest.mark.slow
def test_a_session_that_never_was_recorded_was_none(lab: Lab) -> None:
    lab.consent("P001")
    check_eligibility(lab.visit("P001"))
    assert len(read(lab.places).participants["P001"].sessions) == 1
    assert all_deviations(lab.places) == []
    lab.run("P001")
    (sitting,) = read(lab.places).participants["P001"].sessions
    assert sitting.deviations == []


@pytest.mark.slow
def test_a_session_out_of_its_window_is_refused_and_can_be_waived(tmp_path: Path) -> None:
    lab = Lab(tmp_path, TWO_SESSIONS)
    lab.approve()
    lab.consent("P001")
    with pytest.raises(ProtocolError, match="P001 has not run session 1; session 2 comes after it"):
        check_eligibility(lab.visit("P001", 2))
    lab.run("P001")
    begun = date.fromisoformat(read(lab.places).participants["P001"].sessions[0].date)
    first, last = begun + timedelta(1), begun + timedelta(3)
    for day in (begun, last + timedelta(1)):
        with pytest.raises(
            ProtocolError,
            match=f"session 2 of participant P001 is due {first} to {last}, 1 to 3 days after "
            f"session 1; today is {day}; labcrane waive lets it be run, as a deviation",
        ):
            check_eligibility(lab.visit("P001", 2), day)
    for day in (first, last):
        check_eligibility(lab.visit("P001", 2), day)
    enrolment.waive(lab.places, "P001", 2, "was ill", TODAY)
    check_eligibility(lab.visit("P001", 2), last + timedelta(9))
    assert [(d.what, d.session, d.detail) for _, d in all_deviations(lab.places)] == [
        ("window waived", 2, "was ill")
    ]


def test_who_is_excluded_leaves_the_slot_to_the_next_and_is_not_run(lab: Lab) -> None:
    for name in ("P001", "P002", "P003"):
        lab.consent(name)
    enrolment.exclude(lab.places, "P002", "moved away", TODAY)
    lab.consent("P004")
    slots = {name: entry.slot for name, entry in read(lab.places).participants.items()}
    assert slots == {"P001": 1, "P002": 2, "P003": 3, "P004": 2}
    with pytest.raises(ProtocolError, match=r"P002 was excluded on .*: moved away"):
        check_eligibility(lab.visit("P002"))


def test_a_participant_in_two_groups_is_refused(tmp_path: Path) -> None:
    lab = Lab(tmp_path, GROUPED)
    lab.approve()
    lab.consent("P001")
    other = {"none": "visual", "visual": "sound", "sound": "none"}
    with changed(lab.places) as register:
        entry = register.participants["P001"]
        planned, entry.group = entry.group, other[entry.group]
        written = entry.group
    with pytest.raises(
        ProtocolError,
        match=f"P001 would be in two groups: enrolled in '{written}', but slot 1 of the protocol "
        f"is in '{planned}'",
    ):
        check_eligibility(lab.visit("P001"))


def test_a_pseudonym_that_does_not_match_is_refused(lab: Lab) -> None:
    for name in ("Anna", "P01", "P00001", "P001 "):
        with pytest.raises(ProtocolError, match="does not match the protocol's pattern"):
            lab.consent(name)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("write to anna.nowak@uni.example", "an e-mail address"),
        ("call +48 600 123 456", "a telephone number"),
        ("call 0171/1234567 tomorrow", "a telephone number"),
        ("(22) 555-12-34", "a telephone number"),
        ("tel:600123456", "a telephone number"),
        ("555.123.4567", "a telephone number"),
        ("left-handed, wears glasses", None),
        ("trial 12 of 2026-11-21 at 14:30:05 was 3.25 m off", None),
        ("0.123 0.456 0.789 m", None),
        ("seen @ block 3", None),
        ("index of difficulty, log2(distance / width + 1) (ISO 9241-411:2012)", None),
        ("DIN EN ISO 10968 and ISO/TS 15666-2021", None),
        ("DIN 0171 1234567", "a telephone number"),
        ("ISO 9241-411, call 600 123 456", "a telephone number"),
    ],
)
def test_what_leads_to_a_person_is_found(text: str, found: str | None) -> None:
    assert personal(text) == found


@pytest.mark.slow
def test_a_note_that_leads_to_a_person_is_refused_everywhere(lab: Lab) -> None:
    lab.consent("P001")
    for refused in (
        lambda: enrolment.note(lab.places, "P001", "anna@uni.example"),
        lambda: enrolment.exclude(lab.places, "P001", "call +48 600 123 456", TODAY),
    ):
        with pytest.raises(ProtocolError, match="which could identify a person; remove that"):
            refused()
    lab.run("P001", {30: [Command(Order.NOTE, "mail anna@uni.example")]})
    enrolment.note(lab.places, "P001", "left-handed")
    assert read(lab.places).participants["P001"].notes == ["left-handed"]
    path = lab.places.raw("P001") / "P001.h5"
    (event,) = [
        data
        for name, data in labcrane.open_recording(path).session(1).events[["name", "data"]].values
        if name == "order.note"
    ]
    assert event["text"] == ""
    assert "an e-mail address" in event["refused"]
    for path in lab.places.files():
        assert b"anna@" not in path.read_bytes()


def test_people_need_joysticks_and_leave_no_session_when_there_are_none(tmp_path: Path) -> None:
    from virtual_sticks import desk

    lab = Lab(tmp_path, GOVERNED.replace(PERSON, "{use: dual_joystick}"))
    lab.approve()
    lab.consent("P001")
    from labcrane.testing import run

    with desk(), pytest.raises(DeviceError, match="joystick"):
        run(lab.visit("P001"), Willing())
    assert all_deviations(lab.places) == []
    assert date.fromisoformat(read(lab.places).participants["P001"].enrolled) == TODAY


def _copied_by_hand(lab: Lab, folder: Path, keep: str) -> Lab:
    """Return the study's folder elsewhere, with the recordings but without the register."""
    shutil.copytree(lab.folder, folder, ignore=shutil.ignore_patterns("register"))
    other = lab_in(folder)
    for path in other.places.raw("P001").iterdir():
        if not path.match(keep):
            path.unlink()
    return other


@pytest.mark.slow
@pytest.mark.parametrize("keep", ["*", "*.xdf", "P001.h5"])
def test_recordings_that_were_copied_without_the_register_give_the_same_deviations(
    lab: Lab, tmp_path: Path, keep: str
) -> None:
    lab.run(
        "P001", {40: [Command(Order.SKIP)], 60: [Command(Order.REPEAT)], 90: [Command(Order.END)]}
    )
    run(lab.visit("P001", fast=True, resumed=True), Willing())
    known = [(d.what, d.session, d.trial, d.detail) for _, d in all_deviations(lab.places)]
    assert {"skipped", "trial repeated", "restarted"} <= {what for what, *_ in known}
    copied = _copied_by_hand(lab, tmp_path / "elsewhere", keep)
    found = [(d.what, d.session, d.trial, d.detail) for _, d in all_deviations(copied.places)]
    assert found[0][0] == "not in the register"
    assert found[1:] == known
    copied.consent("P001")
    found = [(d.what, d.session, d.trial, d.detail) for _, d in all_deviations(copied.places)]
    assert found[0] == ("session not in the register", 1, 0, "")
    assert found[1:] == known


@pytest.mark.slow
def test_a_recording_that_is_not_in_the_register_is_named_by_every_command(
    lab: Lab, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lab.run("P001")
    copied = _copied_by_hand(lab, tmp_path / "elsewhere", "*")
    copied.consent("P002")
    (copied.places.root / "P003-PILOT").mkdir()
    (copied.places.root / "P003-PILOT" / "ses-01_run.xdf").write_bytes(b"")
    tables, page = tmp_path / "tables", tmp_path / "page"
    for words in (
        ("participants",),
        ("deviations",),
        ("export", "--to", "tables", "--out", str(tables)),
        ("report", "--out", str(page)),
    ):
        assert main([words[0], str(copied.folder), *words[1:]]) in {0, 3}
        said = " ".join(capsys.readouterr().out.replace("│", " ").split())
        assert re.search("P001[^P]*not in the register", said), words
        assert not re.search("P00[23]-?P?[^P]*not in the register", said), words
    for path in (next(page.glob("*.html")), tables / "participants.csv"):
        assert "not in the register" in path.read_text(encoding="utf-8")


def test_a_damaged_recording_that_is_not_in_the_register_does_not_hide_the_others(
    lab: Lab,
) -> None:
    for name in ("P008", "P009"):
        folder = lab.places.raw(name)
        folder.mkdir(parents=True)
        (folder / f"{name}.h5").write_bytes(b"not HDF5")
        (folder / "ses-02_run.xdf").write_bytes(b"not XDF")
    found = [(name, d.what, d.session) for name, d in all_deviations(lab.places)]
    assert found == [
        (name, what, session)
        for name in ("P008", "P009")
        for what, session in (("not in the register", 0), ("recording cannot be read", 2))
    ]
