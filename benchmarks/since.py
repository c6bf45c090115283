"""Slower or not: the working tree beside an earlier commit, figure by figure.

    python -m benchmarks.since COMMIT [--only tick,start_up] [--rounds 5] [--check]

Both run in one go and in turns, each round the other way about, so that a computer that is busy or
warm is so for both; what counts is the median ratio of the rounds. With ``--check``, the exit
status is 1 when one is above what is allowed. Takes some minutes a round.
"""

import argparse
import io
import json
import os
import statistics
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
SUBJECTS = ("tick", "start_up", "cohort")
ALLOWED = 1.03

MEASURE = """
import json, sys
from importlib import import_module
rows = import_module(f"benchmarks.{sys.argv[1]}").rows(**json.loads(sys.argv[2]))
print()
print(json.dumps({row.what: row.ours for row in rows}))
"""


def main(words: Sequence[str] | None = None) -> int:
    """Measure both in turns, and print a row for each figure; 1 when one is checked and missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("commit", help="what the working tree is compared with")
    parser.add_argument("--only", default=",".join(SUBJECTS), help=f"some of {','.join(SUBJECTS)}")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--check", action="store_true", help=f"fail above {ALLOWED}")
    asked = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as folder:
        before = Path(folder)
        unpack(asked.commit, before)
        beyond = [
            f"{subject}: {what}"
            for subject in asked.only.split(",")
            for what, ratio in ratios(subject, before, asked.rounds).items()
            if not ratio <= ALLOWED
        ]
    print("\n".join(f"MISSED {each}" for each in beyond) or f"nothing is {ALLOWED} times slower")
    return 1 if asked.check and beyond else 0


def unpack(commit: str, folder: Path) -> None:
    """Put a commit's files into a folder."""
    packed = subprocess.run(
        ["git", "archive", "--format=zip", commit], cwd=ROOT, check=True, stdout=subprocess.PIPE
    ).stdout
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        archive.extractall(folder)


def ratios(subject: str, before: Path, rounds: int) -> dict[str, float]:
    """Return by figure the median of what is now over what was before; print each."""
    pairs = []
    for number in range(rounds):
        turn = (before, ROOT) if number % 2 else (ROOT, before)
        found = {tree: figures(subject, tree) for tree in turn}
        pairs.append((found[ROOT], found[before]))
    now, then = pairs[0]
    for what in sorted(now.keys() ^ then.keys()):
        print(f"{subject}: {what}: only {'now' if what in now else 'before'}, not compared")
    medians = {}
    for what in sorted(now.keys() & then.keys()):
        each = [ours[what] / theirs[what] for ours, theirs in pairs]
        medians[what] = statistics.median(each)
        spread = f"[{min(each):.3f}..{max(each):.3f}]"
        print(f"{subject}: {what}: {medians[what]:.3f} {spread} in {rounds} rounds", flush=True)
    return medians


def figures(subject: str, tree: Path) -> dict[str, float]:
    """Return a benchmark's figures of the labcrane in a folder, by their names."""
    few = {"participants": 4} if subject == "cohort" else {}
    path = os.pathsep.join(map(str, (tree, tree / "plugins")))
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, subject, json.dumps(few)],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": path},
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    )
    measured: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return measured


if __name__ == "__main__":
    sys.exit(main())
