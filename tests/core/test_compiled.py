"""Compiled functions: kept for the next process, and compiled by one of those that want them."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from needs import needs

from labcrane.core.compiled import TURN
from labcrane.files.lock import held

LAW = """\
import math

from labcrane.core import compiled


@compiled.tick
def law(own, places, seen, row):
    row[0] = math.sin(seen[0]) + own[places[0]]
    return 0
"""
WANTS = """\
import json
import sys

import numba  # loads for a second, which is no part of what they do at once
import numpy as np
from labcrane.core import compiled

print("ready", flush=True)
sys.stdin.readline()
from law import law

row = np.zeros(1)
law(np.array([2.0]), np.array([0]), np.array([0.5]), row)
stats = law.stats
counts = [sum(each.values()) for each in (stats.cache_misses, stats.cache_hits)]
print(json.dumps([*counts, row[0], stats.cache_path]))
"""


@pytest.mark.slow
@needs("numba")
def test_of_several_processes_that_want_a_function_one_compiles_it(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(LAW)
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": ""}
    wanting = [
        subprocess.Popen(
            [sys.executable, "-c", WANTS], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            text=True, env=environment,
        )
        for _ in range(3)
    ]  # fmt: skip
    try:
        for each in wanting:
            assert each.stdout.readline() == "ready\n"
        for each in wanting:
            each.stdin.write("go\n")
            each.stdin.flush()
        found = [json.loads(each.communicate(timeout=300)[0]) for each in wanting]
    finally:
        for each in wanting:
            each.kill()
            each.wait()
    assert sorted(misses for misses, *_ in found) == [0, 0, 1]
    assert sorted(hits for _, hits, *_ in found) == [0, 1, 1]
    assert len({value for _, _, value, _ in found}) == 1
    (where,) = {place for *_, place in found}
    assert (Path(where) / TURN).exists()
    assert list(Path(where).glob("law.law-*.nbi"))
    with held(Path(where) / TURN, "somebody compiles still"):
        pass
