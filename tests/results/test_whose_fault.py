"""Whose fault an error is: only a recording that is damaged leaves its participant out."""

import fcntl
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest
from needs import UNSHARE, needs
from programs import ran
from rehearsal import SHORT

from labcrane.analysis import measures
from labcrane.testing import main

PEOPLE = [f"P{number:03}" for number in range(1, 5)]
PRODUCTS = {
    "tables": ("export", "--to", "tables"),
    "matlab": ("export", "--to", "matlab"),
    "bids": ("export", "--to", "bids"),
    "psychds": ("export", "--to", "psychds"),
    "xdf": ("export", "--to", "xdf"),
    "report": ("report",),
}


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("people")
    (folder / "study.yaml").write_text(SHORT, encoding="utf-8")
    words = [str(folder / "study.yaml"), "--participants", str(len(PEOPLE))]
    assert main(["simulate", *words, "--out", str(folder / "people")]) == 0
    return folder / "people"


def command(data: Path, product: str, out: Path) -> list[str]:
    verb, *more = PRODUCTS[product]
    return [verb, str(data), "--include", "simulated", "--workers", "1", *more, "--out", str(out)]


def written(out: Path) -> list[Path]:
    return sorted(path for path in out.rglob("*") if path.is_file()) if out.exists() else []


@pytest.mark.slow
@needs("mounts")
@pytest.mark.parametrize("product", PRODUCTS)
def test_a_full_disk_stops_a_product_and_leaves_nobody_out(simulated: Path, product: str) -> None:
    kilobytes = Random(product).randint(12, 60)
    code = (
        "import sys; from pathlib import Path; from labcrane.cli.app import main; "
        "status = main(sys.argv[1:]); "
        "print('left:', [p.name for p in Path('/mnt/out').rglob('*') if p.is_file()]); "
        "sys.exit(status)"
    )
    mounted = f'mount -t tmpfs -o size={kilobytes}k none /mnt && exec "$0" -c "$@"'
    words = command(simulated, product, Path("/mnt/out"))
    done = ran([*UNSHARE, "sh", "-c", mounted, sys.executable, code, *words], timeout=300)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr
    assert "left out" not in done.stdout
    assert "left: []" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("product", ["tables", "bids"])
def test_of_two_exports_into_one_folder_one_is_whole_and_the_other_refused(
    simulated: Path, tmp_path: Path, product: str
) -> None:
    words = [sys.executable, "-m", "labcrane", *command(simulated, product, tmp_path / "out")]
    both = [
        subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    said = [each.communicate(timeout=300) for each in both]
    assert sorted(each.returncode == 0 for each in both) == [False, True], said
    [refusal] = [err for each, (_, err) in zip(both, said, strict=True) if each.returncode]
    assert "is writing into" in refusal or "is not empty, and nothing is overwritten" in refusal
    assert not any("left out" in out for out, _ in said)
    about = next(path for path in written(tmp_path / "out") if path.name == "labcrane_export.json")
    people = json.loads(about.read_text(encoding="utf-8"))["participants"]
    assert [person["included"] for person in people] == ["yes"] * len(PEOPLE)


@pytest.mark.slow
@pytest.mark.parametrize("product", ["tables", "report"])
def test_a_recording_that_another_program_holds_stops_a_product(
    simulated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], product: str
) -> None:
    held = next(simulated.glob("P002*/*.h5"))
    with held.open("rb+") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert main(command(simulated, product, tmp_path / "out")) == 1
    said = capsys.readouterr()
    assert f"{held} cannot be opened now" in said.err
    assert "close the program that holds it" in said.err
    assert "unreadable" not in said.out + said.err
    assert written(tmp_path / "out") == []


@pytest.mark.slow
def test_a_fault_of_labcrane_is_called_so_and_its_traceback_is_kept(
    simulated: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    right: Callable[..., object] = measures.measure_session

    def wrong(session, settings):
        if "P003" in str(session._path):
            raise KeyError("a mistake of ours")
        return right(session, settings)

    monkeypatch.setattr(measures, "measure_session", wrong)
    monkeypatch.setattr(measures, "kept", lambda path, about, made: made())
    assert main(command(simulated, "report", tmp_path / "out")) == 3
    said = capsys.readouterr()
    assert "left out: P003-SIMULATED, cannot be used: a fault of labcrane" in said.out
    assert "unreadable" not in said.out
    assert "recover" not in said.out + said.err
    for kept in (said.err, (tmp_path / "out" / "faults.txt").read_text(encoding="utf-8")):
        assert "a mistake of ours" in kept
        assert "test_whose_fault.py" in kept
    table = (tmp_path / "out" / "tables" / "participants.csv").read_text(encoding="utf-8")
    assert "P003-SIMULATED,fault,no," in table
