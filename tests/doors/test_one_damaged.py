"""One damaged recording among good ones: named and left out, and the others' as without it."""

import random
import shutil
from pathlib import Path

import h5py
import pandas as pd
import pytest
from results.recorded import record, study

from labcrane.testing import main

COMMANDS = {
    "report": ("report",),
    "score": ("score",),
    **{to: ("export", "--to", to) for to in ("tables", "bids", "matlab", "zip")},
}
ZERO_PAGE = 4096


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("lab")
    data, chosen = root / "data", study(root)
    for name in ("P001", "P002", "P003"):
        record(chosen, data, name)
    return data


def truncated(raw: bytearray, dice: random.Random) -> None:
    del raw[dice.randrange(len(raw)) :]


def flipped(raw: bytearray, dice: random.Random) -> None:
    for _ in range(dice.choice([1, 10, 1000])):
        raw[dice.randrange(len(raw))] ^= dice.randrange(1, 256)


def zeroed(raw: bytearray, dice: random.Random) -> None:
    for _ in range(dice.choice([1, 4])):
        at = ZERO_PAGE * dice.randrange(len(raw) // ZERO_PAGE)
        raw[at : at + ZERO_PAGE] = bytes(ZERO_PAGE)


def unsealed(raw: bytearray, dice: random.Random) -> None:
    """As a file of before there were sums: only HDF5 itself finds some of it."""
    del raw[-32:]
    zeroed(raw, dice)


def trials(out: Path, name: str) -> pd.DataFrame:
    table = pd.read_csv(out / "trials.csv")
    return table[table["participant"] == name].reset_index(drop=True)


DAMAGES = [truncated, flipped, zeroed, unsealed]


def words(command: str, data: Path, out: Path) -> list[str]:
    first, *rest = COMMANDS[command]
    out = out / "scored.xlsx" if command == "score" else out
    asked = ["--set", "license=CC0-1.0"] if command == "zip" else []
    return [first, str(data), *rest, "--out", str(out), *asked]


def try_it(lab: Path, folder: Path, capsys, command: str, damage, seed: int) -> None:
    dice = random.Random(f"{command} {damage.__name__} {seed}")
    data, out = folder / "data", folder / "out"
    shutil.copytree(lab, data)
    path = data / "P002" / "P002.h5"
    raw = bytearray(path.read_bytes())
    damage(raw, dice)
    path.write_bytes(raw)
    capsys.readouterr()
    code = main(words(command, data, out))
    got = capsys.readouterr()
    said = " ".join((got.out + got.err).split())
    about = f"{command}, {damage.__name__}, seed {seed}: exit {code}: {said[-800:]}"
    assert "Traceback" not in said, about
    # What a command does not read may be damaged without a word: no number of it is used.
    assert code in ((1, 3) if command == "score" else (0, 3)), about
    assert code != 3 or "P002" in said, about
    if command == "tables":
        assert set(pd.read_csv(out / "trials.csv")["participant"]) >= {"P001", "P003"}
        for name in ("P001", "P003"):
            pd.testing.assert_frame_equal(trials(out, name), trials(lab.parent / "good", name))
        mine = trials(out, "P002")
        assert mine.empty == (code == 3), about
        if code == 0 and damage is not unsealed:
            pd.testing.assert_frame_equal(mine, trials(lab.parent / "good", "P002"))


@pytest.fixture(scope="module", autouse=True)
def good(lab: Path) -> None:
    assert main(words("tables", lab, lab.parent / "good")) == 0


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_damaged_recording_is_named_and_the_others_are_used(
    lab: Path, tmp_path: Path, capsys, command: str
) -> None:
    seed = 0
    damage = random.Random(f"{command} 2026").choice(DAMAGES)
    try_it(lab, tmp_path, capsys, command, damage, seed)


@pytest.mark.soak
@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("command", COMMANDS)
def test_recordings_damaged_in_many_ways_are_named_and_the_others_are_used(
    lab: Path, tmp_path: Path, capsys, command: str, damage
) -> None:
    for seed in range(1, 11):
        try_it(lab, tmp_path / str(seed), capsys, command, damage, seed)


@pytest.mark.slow
def test_a_recording_that_lost_its_trials_is_named_by_score_and_no_other_is(
    lab: Path, tmp_path: Path, capsys
) -> None:
    """Without a sum, HDF5 finds nothing wrong with a column that is gone."""
    data = tmp_path / "data"
    shutil.copytree(lab, data)
    with h5py.File(data / "P002" / "P002.h5", "r+") as file:
        del file["ses-01/trials"]
    assert main(words("score", data, tmp_path / "out")) != 0
    got = capsys.readouterr()
    said = " ".join((got.out + got.err).split())
    assert "Traceback" not in said
    assert "left out: P002" in said
    assert "left out: P001" not in said
