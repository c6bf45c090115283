"""Means on the pages leave out practice and movements without success, in each language."""

import re
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from docs.page import BASE, PROGRAMS, ROOT, Block, blocks
from needs import need
from programs import ran

TASK = "{use: aiming, distances: [2], movements: 2}"
OTHER = "{use: aiming, distances: [1.5, 2.5], movements: 4, limit_s: 7.6}"
BLOCK = "      - block: {task: aiming, pairs: 1}"
BLOCKS = "      - practice: {task: aiming, pairs: 1}\n      - block: {task: aiming, pairs: 3}"
STUDY = BASE.replace(TASK, OTHER, 1).replace(BLOCK, BLOCKS)


@pytest.fixture(scope="module")
def participant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording with practice, and with movements that reached their time limit."""
    folder = tmp_path_factory.mktemp("means")
    (folder / "protocol.yaml").write_text(STUDY, encoding="utf-8")
    command = ["run", str(folder / "protocol.yaml"), "--participant", "P001", "--simulate"]
    subprocess.run([sys.executable, "-m", "labcrane", *command, "--fast"], check=True)
    return folder / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5"


def true_means(path: Path) -> tuple[dict[float, float], float]:
    """Return the mean movement time by distance, and that of all, counted row by row."""
    found: dict[float, list[float]] = {}
    with h5py.File(path) as file:
        trials = file["ses-01/trials"]
        rows = zip(
            trials["practice"], trials["outcome"], trials["distance"], trials["movement_time"],
            strict=True,
        )  # fmt: skip
        left_out = set()
        for practice, outcome, distance, time in rows:
            if practice or outcome != b"success":
                left_out.add((int(practice), outcome))
            else:
                found.setdefault(round(float(distance), 6), []).append(float(time))
    assert {practice for practice, _ in left_out} == {0, 1}, "the recording is too tidy"
    assert sum(map(len, found.values())) > 2
    every = [time for times in found.values() for time in times]
    return {distance: np.mean(times) for distance, times in found.items()}, np.mean(every)


def of_means(page: str, language: str) -> list[Block]:
    """Return a page's blocks of a language up to the one that prints a mean."""
    found = [block for block in blocks(ROOT / "docs" / page) if block.language == language]
    last = next(k for k, block in enumerate(found) if "mean" in block.text)
    return found[: last + 1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "language"),
    [
        ("first-analysis.md", "python"),
        ("recipes.md", "python"),
        ("recipes.md", "r"),
        ("recipes.md", "octave"),
    ],
)
def test_a_mean_on_a_page_is_of_counted_movements(
    page: str, language: str, participant: Path, tmp_path: Path
) -> None:
    found = of_means(page, language)
    need(*(name for block in found for name in block.needs))
    (tmp_path / "P001.h5").write_bytes(participant.read_bytes())
    program, options, name = PROGRAMS.get(language, (sys.executable, "", "page.py"))
    (tmp_path / name).write_text("\n".join(block.text for block in found), encoding="utf-8")
    command = [program, *options.split(), name]
    done = ran(command, cwd=tmp_path, check=True)
    by_distance, of_all = true_means(participant)
    printed = [float(number) for number in re.findall(r"\d+\.\d+", done.stdout)]
    for mean in [of_all] if language == "octave" else by_distance.values():
        assert min(abs(number - mean) for number in printed) < 6e-4 * mean, done.stdout
