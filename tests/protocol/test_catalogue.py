"""Wrong protocols, drawn from right ones: each is refused or questioned in its line, or runs."""

import random
import re
from collections.abc import Iterable, Sequence, Set
from pathlib import Path

import pytest
from wrong_protocols import PROTOCOLS, SKELETONS, Wrong, faults, lay_out, right, texts

from labcrane import ProtocolError
from labcrane.protocol.questions import about, questions
from labcrane.simulation import rehearsal
from labcrane.testing import Registry, Study, load

STUDIES = (*sorted(path.parent.name for path in PROTOCOLS.glob("*/protocol.yaml")), *SKELETONS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("wrong")
    for study in STUDIES:
        lay_out(study, place / study)
    return place


JARGON = re.compile(
    r"valid (tuple|list|dict|boolean)|literal\[|[Ii]nput should|codec|function-|NoneType|<class|"
    r"Unable to|String should|Traceback|ScannerError|<block|None\b|(?<!\.)\bnan\b"
)
"""Words of programmers."""

REMEDY = re.compile(
    r"; |must be|did you mean|did you write|there is no .*; |needs |possible:|is that meant"
)
MISSPELT = "key misspelt as "
NEAR = 4
"""Letters of a name that is found again when one of them is another."""

LONGEST = 700
"""Characters of a message: all events of a session are named in one."""


def assert_in_the_file(at: Iterable[tuple[int, int]], wrong: Wrong) -> None:
    """Assert that something stands at every place, or ends there."""
    try:
        text = wrong.text.decode()
    except UnicodeDecodeError:
        return  # its places are counted in characters that are none
    lines = text.split("\n")
    for line, column in at:
        assert 1 <= line <= len(lines), (str(wrong), line, column)
        assert 1 <= column <= len(lines[line - 1]) + 1, (str(wrong), line, column)


def assert_the_nearest_is_named(wrong: Wrong, lines: Sequence[str]) -> None:
    """Assert that a key of which one letter is wrong is told with a key that there is."""
    if not wrong.fault.startswith(MISSPELT) or len(str(wrong.place[-1])) < NEAR:
        return
    unknown = re.compile(f"{wrong.fault.removeprefix(MISSPELT)!r} is (not a|no) key of")
    for line in lines:
        assert not unknown.search(line) or "did you mean '" in line, (str(wrong), line)


def standing(study: str, path: Path, registry: Registry) -> frozenset[str]:
    """Return what is asked of the right protocol."""
    path.write_text(right(study, registry), encoding="utf-8")
    return frozenset(each.text for each in questions(load(path, registry)))


def judge(
    wrong: Wrong, path: Path, registry: Registry, stands: Set[str] = frozenset()
) -> Study | None:
    """Judge what a check says of a fault, beyond what is asked of the right protocol as it stands.

    Returns
    -------
    Study or None
        The study where it passes.
    """
    path.write_bytes(wrong.text)
    try:
        study = load(path, registry)
    except ProtocolError as error:
        lines = str(error).replace(f"{path}:", "").splitlines()
        found = [re.match(r"(\d+):(\d+): ", line) for line in lines]
        at = {(int(each[1]), int(each[2])) for each in found if each}
        assert lines, wrong
        assert all(found), (str(wrong), lines)
        assert_in_the_file(at, wrong)
        # What is missed is told where it is missed, which may be elsewhere.
        missed = bool(wrong.gone) or "undefined alias" in lines[0]
        if wrong.gone:
            for line, each in zip(lines, found, strict=True):
                assert wrong.is_missed(int(each[1]), line), (str(wrong), line)
        here = {column for line, column in at if line == wrong.line}
        assert here or wrong.line == 0 or missed, (str(wrong), wrong.line, lines)
        if not missed and wrong.fault.startswith("key misspelt"):
            # What a mapping needs as a whole is told of the mapping, and not of its key.
            unknown = [line for line in lines if re.search("is (not a|no) key of", line)]
            assert here & wrong.columns or not unknown, (str(wrong), wrong.columns, lines)
        elif wrong.columns and not missed:
            assert here & wrong.columns, (str(wrong), wrong.columns, lines)
        assert_the_nearest_is_named(wrong, lines)
        for line in lines:
            assert REMEDY.search(line), (str(wrong), line)
            assert not JARGON.search(line), (str(wrong), line)
            assert len(line) < LONGEST, (str(wrong), line)
        return None
    asked = [each for each in questions(study) if each.text not in stands]
    assert asked or not wrong.must, f"{wrong}: passed"
    told = [about(study, question) for question in asked]
    if wrong.must and wrong.line:
        assert wrong.line in {each["line"] for each in told}, (str(wrong), wrong.line, told)
    for each in told:
        assert REMEDY.search(each["message"]), (str(wrong), each["message"])
        assert not JARGON.search(each["message"]), (str(wrong), each["message"])
    assert_in_the_file({(each["line"], each["column"]) for each in told}, wrong)
    return study


def drawn(study: str, registry: Registry, count: int, seed: int) -> Sequence[Wrong]:
    text = right(study, registry)
    every = [*texts(study, text), *faults(study, text, seed)]
    return random.Random(f"{study} {seed}").sample(every, min(count, len(every)))


@pytest.mark.slow
@pytest.mark.parametrize("study", STUDIES)
def test_a_fault_drawn_at_random_is_told_in_its_line_with_its_remedy(
    study: str, folder: Path, registry: Registry
) -> None:
    path = folder / study / "protocol.yaml"
    stands = standing(study, path, registry)
    for wrong in drawn(study, registry, 20, seed=1):
        judge(wrong, path, registry, stands)


SHARDS = 8


@pytest.mark.soak
@pytest.mark.timeout(1800)  # minutes of a processor, of which a busy computer has few to give
@pytest.mark.parametrize("shard", range(SHARDS))
@pytest.mark.parametrize("study", STUDIES)
def test_every_fault_of_every_protocol_is_told_or_runs(
    study: str, shard: int, folder: Path, registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rehearsal, "PATIENCE_S", 0.2)
    monkeypatch.setattr(rehearsal, "PATIENCE", 0.0)
    text = right(study, registry)
    path = folder / study / "protocol.yaml"
    stands = standing(study, path, registry)
    failed = []
    for wrong in [*texts(study, text), *faults(study, text)][shard::SHARDS]:
        try:
            found = judge(wrong, path, registry, stands)
        except AssertionError as error:
            failed.append(f"{wrong}: {error}")
            continue
        if found is None or {each.text for each in questions(found)} - stands:
            continue  # refused or questioned: it need not run
        try:
            rehearsal.rehearse(found)
        except ProtocolError as error:
            failed.append(f"{wrong}: passed, and a rehearsal says: {error}")
    assert not failed, "\n".join(failed)
