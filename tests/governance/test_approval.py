"""Approving a study, amending it, and when an approval no longer holds."""

import json
from datetime import date, timedelta
from pathlib import Path

import pytest
from governance.approved_lab import approved_lab, refusal
from governed import PERSON, TODAY, Lab, edit

from labcrane import InputDevice, ProtocolError
from labcrane.approval.decision import Grant, amend, approve
from labcrane.approval.lock import lock_path, read_lock
from labcrane.session.eligibility import EXEMPT, check_eligibility
from labcrane.testing import discover


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    return approved_lab(tmp_path)


def test_an_expired_approval_is_refused(lab: Lab) -> None:
    last = date.fromisoformat(read_lock(lab.protocol).approval["valid_until"])
    check_eligibility(lab.visit("P001"), last)
    with pytest.raises(
        ProtocolError,
        match=rf"the approval 'KB-12/2026' was valid until {last}, today is .*labcrane amend",
    ):
        check_eligibility(lab.visit("P001"), last + timedelta(1))


def test_a_lock_that_was_edited_by_hand_is_refused(lab: Lab) -> None:
    edit(lock_path(lab.protocol), "KB-12/2026", "KB-13/2026")
    with pytest.raises(
        ProtocolError, match="was edited by hand or is damaged: its content does not match its seal"
    ):
        check_eligibility(lab.visit("P001"))
    lock_path(lab.protocol).write_text("{", encoding="utf-8")
    with pytest.raises(ProtocolError, match="was edited by hand or is damaged: it cannot be read"):
        check_eligibility(lab.visit("P001"))


def test_a_study_that_was_never_approved_is_refused_for_people_only(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    with pytest.raises(
        ProtocolError, match=r"has not been approved: .* labcrane approve, or .* --pilot"
    ):
        check_eligibility(lab.visit("P001"))
    assert check_eligibility(lab.visit("P001", pilot=True)).slot is None
    assert check_eligibility(lab.visit("P001", simulated=True)).slot is None


def test_pilots_run_whatever_has_drifted_and_stamp_it(lab: Lab) -> None:
    from rehearsal import ScriptedConsole

    import labcrane
    from labcrane.testing import run

    edit(lab.protocol, "movements: 1", "movements: 2")
    path = run(lab.visit("P001", pilot=True, simulated=True, fast=True), ScriptedConsole())
    assert path.name == "P001-PILOT-SIMULATED.h5"
    recording = labcrane.open_recording(path)
    assert recording.participant == "P001-PILOT-SIMULATED"
    assert recording.session(1).attrs["pilot"] == "yes"
    assert recording.session(1).attrs["approval"] == "none"


def test_a_study_is_approved_once(lab: Lab) -> None:
    with pytest.raises(ProtocolError, match=r"approved already, under 'KB-12/2026'; .*amend"):
        lab.approve()


@pytest.mark.parametrize(
    ("consent", "until", "said"),
    [
        ("nowhere.pdf", 9, r"there is no consent text .*nowhere\.pdf; give its file with"),
        ("../consent.txt", 9, r"is not in the folder of the protocol"),
        ("consent_v2.txt", -1, r"the approval ended on .*, today is"),
    ],
)  # fmt: skip
def test_an_impossible_grant_is_refused(
    tmp_path: Path, consent: str, until: int, said: str
) -> None:
    (tmp_path / "study").mkdir()
    lab = Lab(tmp_path / "study")
    (tmp_path / "consent.txt").write_text("x", encoding="utf-8")
    grant = Grant("B", "R", TODAY + timedelta(until), lab.folder / consent)
    with pytest.raises(ProtocolError, match=said):
        approve(lab.study, lab.registry, grant, TODAY)
    assert not lock_path(lab.protocol).exists()


def test_an_amendment_says_what_was_changed_and_keeps_the_history(lab: Lab) -> None:
    first = read_lock(lab.protocol)
    edit(lab.protocol, "movements: 1", "movements: 2")
    grant = Grant("Ethics board", "KB-12/2026-A1", TODAY + timedelta(700), first.consent)
    amended = amend(lab.study, lab.registry, grant, "more movements", TODAY)
    (entry,) = read_lock(lab.protocol).amendments
    assert entry["why"] == "more movements"
    assert entry["reference"] == "KB-12/2026-A1"
    assert entry["replaces"] == first.seal
    assert entry["changes"][0] == "protocol: tasks.aiming.movements was 1, is 2"
    assert refusal(lab) == []
    kept = lab.folder / "study.lock.1.json"
    assert json.loads(kept.read_text(encoding="utf-8"))["seal"] == first.seal
    edit(lab.folder / "hello.md", "Hello", "Good morning")
    again = amend(lab.study, lab.registry, grant, "friendlier", TODAY)
    assert [entry["why"] for entry in again.amendments] == ["more movements", "friendlier"]
    assert again.amendments[1]["replaces"] == amended.seal
    with pytest.raises(ProtocolError, match="is as it was approved; there is nothing to amend"):
        amend(lab.study, lab.registry, grant, "again", TODAY)


def test_an_amended_consent_text_needs_a_new_consent(lab: Lab) -> None:
    edit(lab.folder / "consent_v2.txt", "at any time", "whenever I like")
    lock = read_lock(lab.protocol)
    grant = Grant("Ethics board", "A1", TODAY + timedelta(99), lock.consent)
    amend(lab.study, lab.registry, grant, "clearer", TODAY)
    with pytest.raises(ProtocolError, match=r"has not consented to .*, only to version"):
        check_eligibility(lab.visit("P001"))
    lab.consent("P001")
    check_eligibility(lab.visit("P001"))


def test_an_input_that_needs_nobody_is_refused_for_people_and_runs_as_a_pilot(
    tmp_path: Path,
) -> None:
    lab = Lab(tmp_path)
    lab.approve()
    edit(lab.protocol, PERSON, "{use: simulated_operator}")
    told = "simulated_operator moves the controls without a person; .*--simulate or --pilot"
    with pytest.raises(ProtocolError, match=told):
        check_eligibility(lab.visit("P001"))
    with pytest.raises(ProtocolError, match=told):
        amend(lab.study, lab.registry, lab.grant(), "nobody comes", TODAY)
    lock_path(lab.protocol).unlink()
    with pytest.raises(ProtocolError, match=told):
        approve(lab.study, lab.registry, lab.grant(), TODAY)
    assert check_eligibility(lab.visit("P001", pilot=True)) == EXEMPT


def test_the_inputs_without_a_person_are_known() -> None:
    offers = discover().offers[InputDevice].values()
    alone = {offer.name for offer in offers if not offer.settings.person}
    assert alone == {"recorded", "scenario_operator", "simulated_operator", "toward_target"}
