"""Whatever a check passes, a simulated run ends in order: protocols changed at random."""

import copy
import json
import random
import shutil
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML
from wrong_protocols import Entry, entries, lay_out, misspelt, right

from labcrane import LabcraneError
from labcrane.core import Event
from labcrane.files.pseudonyms import pseudonyms
from labcrane.protocol.questions import questions
from labcrane.protocol.study import load
from labcrane.registry.registry import Registry, discover
from labcrane.session.commands import Command, Order
from labcrane.session.session import run
from labcrane.session.visit import Visit

TICKS, MORE_TICKS = 1500, 20_000
"""After which a session is ended, as an examiner may at any time; the second reach its tasks."""

VALUES = [
    0, 1, -1, 2, 3, 0.5, 1e-9, 1e6, 1e300, 10**12, True, None, "", "x", "no", "2 m", "10 ms", "all",
    "none", "group", "trigger", "log", "tip", [], {}, [1], ["ball"], {"use": "sphere"}, "left.x",
]  # fmt: skip


class Impatient:
    """An examiner who ends the session after some ticks."""

    def __init__(self, ticks: int) -> None:
        self._left = ticks

    def commands(self) -> list[Command]:
        self._left -= 1
        return [Command(Order.END, "enough")] if self._left == 0 else []

    def report(self, event: Event) -> None:
        """Nothing to do."""


def mutated(data: Any, there: list[Entry], dice: random.Random) -> Any:
    """Return a protocol with one to three things removed, exchanged, misspelt or put elsewhere."""
    data = copy.deepcopy(data)
    for _ in range(dice.choice([1, 1, 2, 3])):
        *way, last = dice.choice(there).place
        holder = data
        try:
            for step in way:
                holder = holder[step]
            value = holder[last]
        except (KeyError, IndexError, TypeError):
            continue  # gone with an earlier change
        if isinstance(holder, str):
            continue  # it was a list before an earlier change
        match dice.randrange(5):
            case 0:
                del holder[last]
            case 1 if isinstance(value, str) and value:
                holder[last] = misspelt(dice, value)
            case 2 if isinstance(value, int | float):
                holder[last] = value * dice.choice([0, -1, 0.1, 2, 10, 1000])
            case 3 if isinstance(value, list) and value:
                holder[last] = dice.choice([value[:1], value * 2, value[::-1]])
            case _:
                holder[last] = dice.choice(VALUES)
    return data


def try_mutations(
    folder: Path,
    registry: Registry,
    count: int,
    seed: int,
    of: str = "everything",
    ticks: int = TICKS,
) -> tuple[int, int]:
    """Check protocols changed at random, and run what passes; return how many passed and ran.

    What passes, and is asked nothing that is not asked of the right one, runs.
    """
    lay_out(of, folder / "study")
    path = folder / "study" / "protocol.yaml"
    text = right(of, registry)
    path.write_text(text, encoding="utf-8")
    standing = {each.key for each in questions(load(path, registry))}
    data = json.loads(json.dumps(YAML(typ="safe").load(text)))
    there, dice = entries(text), random.Random(seed)
    passed = ran = 0
    for number in range(count):
        path.write_text(json.dumps(mutated(data, there, dice)), encoding="utf-8")
        try:
            study = load(path, registry)
            study.check_installed(simulated=True, feedback=False)
        except LabcraneError:
            continue
        passed += 1
        try:
            name = pseudonyms(study.protocol.participants.pattern, 1)[0]
            session = random.Random(f"{seed} {number}").randint(1, len(study.protocol.sessions))
            visit = Visit(study, name, session, folder / f"data{number}", simulated=True, fast=True)
            run(visit, Impatient(ticks))
        except LabcraneError as error:
            asked = {each.key for each in questions(study)} - standing
            error.add_note(f"mutation {number} of seed {seed}: {path.read_text()}")
            if not asked:
                raise
            continue
        except Exception as error:
            error.add_note(f"mutation {number} of seed {seed}: {path.read_text()}")
            raise
        finally:
            shutil.rmtree(folder / f"data{number}", ignore_errors=True)
        ran += 1
    return passed, ran


@pytest.mark.long
def test_two_hundred_changed_protocols_are_refused_or_run(tmp_path: Path) -> None:
    passed, ran = try_mutations(tmp_path, discover(), 200, seed=1)
    assert passed > 10
    assert ran >= 0.9 * passed  # what is said by the run alone is rare


@pytest.mark.soak
@pytest.mark.timeout(1800)  # minutes of a processor, of which a busy computer has few to give
@pytest.mark.parametrize("seed", range(10))
def test_five_thousand_changed_protocols_are_refused_or_run(tmp_path: Path, seed: int) -> None:
    of = ("everything", "aiming", "otherwise", "crane_pilot", "retrieval")[seed % 5]
    passed, ran = try_mutations(tmp_path, discover(), 500, 100 + seed, of, MORE_TICKS)
    assert ran >= 0.9 * passed
