"""Bullet in a process whose locale writes commas, as a plugin may set it."""

import locale
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cranes
import dmd_arms
import numpy as np
import pytest
from cranes import needs_bullet
from needs import needs
from plugins.test_ragdoll import text_of

from labcrane.testing import ch8

pytestmark = [needs_bullet, needs("locales")]

COMMAS = "de_DE.UTF-8"


@pytest.fixture(scope="module")
def locales(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("locales")
    command = ["localedef", "-i", "de_DE", "-f", "UTF-8", str(folder / COMMAS)]
    subprocess.run(command, check=True, capture_output=True)
    return folder


@contextmanager
def commas(locales: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let the process write commas; a reader of points reads 0,9 as 0 meanwhile."""
    before = locale.setlocale(locale.LC_NUMERIC)
    monkeypatch.setenv("LOCPATH", str(locales))
    locale.setlocale(locale.LC_NUMERIC, COMMAS)
    try:
        assert locale.str(0.9) == "0,9"
        yield
        assert locale.str(0.9) == "0,9", "the plugin that set it finds it as it was"
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)


def driven(name: str, folder: Path) -> np.ndarray:
    """Return the states of a machine that is driven by the same sticks each time."""
    dice = np.random.default_rng(5)
    if name == "crane":
        grapple = {"mass_kg": 0.9, "length_m": 0.9, "size_m": 0.3}
        with cranes.standing("bullet_crane", ch8(), grapple=grapple) as crane:
            return cranes.drive(crane, dice.uniform(-0.3, 0.3, (60, 4)))
    scene = text_of() if name == "figure" else None
    with dmd_arms.standing(scene, folder) as (arm, _):
        return dmd_arms.step(arm, 0.2, arm=float(dice.uniform(0.2, 0.4)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["crane", "arm", "figure"])
def test_a_machine_moves_alike_where_numbers_have_commas(
    name: str, locales: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = driven(name, tmp_path)
    with commas(locales, monkeypatch):
        np.testing.assert_array_equal(driven(name, tmp_path), plain)
