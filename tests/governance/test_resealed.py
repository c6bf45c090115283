"""A lock that somebody wrote anew and sealed anew: noticed by what else knows of it."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from governed import TODAY, Lab

from labcrane import ProtocolError
from labcrane.approval.decision import amend, verify
from labcrane.approval.lock import Lock, lock_path, read_lock
from labcrane.approval.materials import content
from labcrane.cli.consent import missing_consent
from labcrane.session.eligibility import check_eligibility
from labcrane.testing import main

OTHER = "I take part, and cannot stop.\n"


@pytest.fixture(scope="module")
def run_once(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    lab = Lab(tmp_path_factory.mktemp("lab"))
    lab.approve()
    lab.run("P001")
    return lab


@pytest.fixture
def lab(run_once: Lab, tmp_path: Path) -> Lab:
    shutil.copytree(run_once.folder, tmp_path / "lab")
    copy = Lab(tmp_path / "lab")
    assert read_lock(copy.protocol).seal == read_lock(run_once.protocol).seal
    return copy


def resealed(lab: Lab, change: Callable[[dict[str, Any]], object]) -> None:
    """Write the lock with other content and a seal that fits it, as no hand edit would."""
    path = lock_path(lab.protocol)
    written = json.loads(path.read_text(encoding="utf-8"))
    del written["seal"]
    change(written)
    Lock(path, written).write()


def swapped(lab: Lab) -> None:
    """Swap the consent text, in its file and in a lock that is sealed anew."""
    text = lab.folder / "consent_v2.txt"
    text.write_text(OTHER, encoding="utf-8")
    resealed(lab, lambda lock: lock["materials"]["consent"].update({text.name: content(text)}))
    verify(lab.study, lab.registry, TODAY)  # by itself it is as good as the approved one


@pytest.mark.slow
def test_a_swapped_consent_text_is_noticed_wherever_somebody_is_to_take_part(
    lab: Lab, capsys: pytest.CaptureFixture[str]
) -> None:
    approved = read_lock(lab.protocol).seal
    lab.consent("P002")
    swapped(lab)
    match = (
        "contains no amendment that replaces that lock.*\n"
        rf"  P001, session 1 of .*: {approved[:12]}"
    )
    for name in ("P001", "P002", "P003"):
        with pytest.raises(ProtocolError, match=match):
            check_eligibility(lab.visit(name))
        with pytest.raises(ProtocolError, match=match):
            missing_consent(lab.visit(name))
    words = ["consent", str(lab.protocol), "P003", "--data", str(lab.places.root)]
    assert main(words) == 2
    assert "is not the lock under which people took part" in capsys.readouterr().err


@pytest.mark.slow
def test_amendments_are_followed_back_to_the_lock_under_which_people_took_part(lab: Lab) -> None:
    for number, text in enumerate((OTHER, f"{OTHER}Really.\n")):
        (lab.folder / "consent_v2.txt").write_text(text, encoding="utf-8")
        amend(lab.study, lab.registry, lab.grant(), f"change {number}", TODAY)
        lab.consent("P002")
        check_eligibility(lab.visit("P002"))
    # ... and a swap is found behind them as well.
    swapped(lab)
    resealed(lab, lambda lock: lock["history"].pop())
    with pytest.raises(ProtocolError, match="P002, session 1"):
        check_eligibility(lab.visit("P002"))


SHAPES: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "no consent text": (
        lambda lock: lock["materials"].pop("consent"),
        "its approval is of the consent text 'consent_v2.txt', but its materials contain another",
    ),
    "another file": (
        lambda lock: lock["approval"].update(consent="other.txt"),
        "its approval is of the consent text 'other.txt', but its materials contain another",
    ),
    "a file elsewhere": (
        lambda lock: (
            lock["approval"].update(consent="../other.txt"),
            lock["materials"].update(consent={"../other.txt": {"lines": []}}),
        ),
        "its consent text '../other.txt' is not in the folder of the protocol",
    ),
    "two texts": (
        lambda lock: lock["materials"]["consent"].update(other={}),
        "its materials contain another",
    ),
    "no day": (
        lambda lock: lock["approval"].update(valid_until="soon"),
        "'soon', which is not a date",
    ),
    "no board": (lambda lock: lock["approval"].pop("board"), "its approval lacks board,"),
    "no approval": (lambda lock: lock.update(approval=[]), "it lacks the approval"),
    "no history": (lambda lock: lock.pop("history"), "the materials or the history"),
    "a history of words": (lambda lock: lock.update(history=["x"]), "or the history"),
    "no materials": (lambda lock: lock.update(materials=None), "the materials or the history"),
}


@pytest.mark.parametrize("case", SHAPES.values(), ids=SHAPES)
def test_a_lock_that_labcrane_would_not_write_is_refused_however_it_is_sealed(
    lab: Lab, case: tuple[Callable[[dict[str, Any]], object], str]
) -> None:
    change, why = case
    resealed(lab, change)
    with pytest.raises(ProtocolError, match="was edited by hand or is damaged") as told:
        verify(lab.study, lab.registry, TODAY)
    assert why in str(told.value)
