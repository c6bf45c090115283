"""Entry points as labcrane reads them, beside the standard library's reading of them."""

import importlib
import random
import string
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import pytest

from labcrane.registry import entry_points as reader
from labcrane.registry.entry_points import entry_points_of

SEEDS = range(40)
GROUPS = ("labcrane", "labcrane.offers", "console_scripts", "pytest11")
LINES = ("# a note", "", "   ", "#labcrane = not_this")


@pytest.fixture(autouse=True)
def unread() -> Iterator[None]:
    """Read anew, before and after: what was read is kept by the path it was read from."""
    reader._all.cache_clear()
    yield
    reader._all.cache_clear()


def word(draw: random.Random) -> str:
    return "".join(draw.choices(string.ascii_letters + "_", k=draw.randint(1, 8)))


def install(draw: random.Random, folder: Path, name: str) -> None:
    """Write a distribution's metadata as pip, or as setuptools once did, would leave it."""
    ending = draw.choice([".dist-info", ".egg-info", ".DIST-INFO"])
    info = folder / f"{name.replace('-', '_')}-{draw.randint(0, 9)}.{draw.randint(0, 9)}{ending}"
    info.mkdir(parents=True, exist_ok=True)
    about = "PKG-INFO" if ending == ".egg-info" else "METADATA"
    (info / about).write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", "utf-8")
    if draw.random() < 0.2:  # as most distributions, it offers nothing
        return
    lines = []
    for group in draw.sample(GROUPS, draw.randint(1, len(GROUPS))):
        lines.append(f"[{group}]")
        for _ in range(draw.randint(0, 3)):
            value = ".".join(word(draw) for _ in range(draw.randint(1, 3)))
            value += draw.choice(["", f":{word(draw)}", f" : {word(draw)}.{word(draw)}"])
            lines += [f"{word(draw)}{draw.choice([' = ', '=', '  =  '])}{value}"]
            lines += draw.choices(LINES, k=draw.randint(0, 1))
    (info / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")


def listed(points: object) -> set[tuple[str, str, str, str]]:
    return {(one.name, one.value, one.module, one.dist.name) for one in points}  # type: ignore[attr-defined]


@pytest.mark.parametrize("seed", SEEDS)
def test_whatever_is_installed_offers_what_the_standard_library_says(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw = random.Random(seed)
    places = [tmp_path / f"site{number}" for number in range(3)]
    for place in places[:2]:  # the third is on the path, and not there
        # One distribution can be in two folders, under other spellings: the first one counts.
        names = [word(draw) + str(number) for number in range(draw.randint(0, 5))]
        for name in [*names, draw.choice(["Twice.Named", "twice-named", "twice_Named"])]:
            install(draw, place, name)
    monkeypatch.setattr(sys, "path", [str(place) for place in places])
    importlib.invalidate_caches()
    for group in GROUPS:
        assert listed(entry_points_of(group)) == listed(entry_points(group=group))


def test_what_is_installed_here_is_what_the_standard_library_says() -> None:
    for group in GROUPS:
        assert listed(entry_points_of(group)) == listed(entry_points(group=group))
    assert len(entry_points_of("labcrane")) > 5


@pytest.mark.parametrize("value", ["json", "json:dumps", "os.path:join", "json:JSONEncoder.encode"])
def test_an_entry_point_gives_what_the_standard_library_gives_for_it(value: str) -> None:
    own = reader.EntryPoint("it", value, "labcrane", Path())
    assert own.load() is EntryPoint("it", value, "labcrane").load()
