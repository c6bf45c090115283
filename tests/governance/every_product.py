"""A study with every product of every command, and what is in every file that is left of it."""

import gzip
import io
import re
import shutil
import zipfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import h5py
import pandas as pd
from governance.kept_people import files, killed_at
from governed import GOVERNED, TODAY, Lab
from needs import GRAPHICS, missing
from pyarrow import parquet

from labcrane.analysis.report.workbook import write_csv, write_workbook
from labcrane.analysis.scoring.indicator import Performance, indicate
from labcrane.analysis.scoring.operator_tests import OperatorTest
from labcrane.analysis.scoring.settings import IndicatorSettings
from labcrane.cli.commands import simulate
from labcrane.participants import recovery, written_about
from labcrane.participants.folders import Places
from labcrane.participants.products import product
from labcrane.participants.register import read
from labcrane.testing import main

PEOPLE = ("P001", "P0011", "VP-001")
"""Each name, or its number, is a part of another."""

STUDY = GOVERNED.replace(
    "title:", "participants: {pattern: '(P\\d{3,4})|(VP-\\d{3})', planned: 4}\ntitle:"
)
VIEW = "views: {operator: {use: view, renderer: software, size: [160, 90]}}\n"
EXPORTS = ("tables", "psychds", "matlab", "bids", "xdf", "zip")


RUN: set[str] = set()
"""Commands that were run to make everything."""


def command(*words: object) -> None:
    assert main([str(word) for word in words]) == 0, words
    RUN.add(str(words[0]) if words[0] != "feedback" else f"{words[0]} {words[1]}")


def everything(folder: Path) -> Lab:
    """Return a study of three people with all that can be made of their data, also elsewhere."""
    (folder / "lab").mkdir(parents=True)
    (folder / "store").mkdir()
    (folder / "elsewhere").mkdir()
    lab = Lab(folder / "lab", STUDY)
    lab.approve()
    for name in PEOPLE:
        lab.run(name)
    data, elsewhere = lab.places.root, folder / "elsewhere"
    for number, exporter in enumerate(EXPORTS):
        out = (data / "exports" if number % 2 else elsewhere) / exporter
        asked = ("--set", "license=CC0-1.0") if exporter == "zip" else ()
        command("export", data, "--to", exporter, "--out", out, *asked)
    command("report", data, "--out", elsewhere / "report")
    command("plan", lab.protocol, "--export", elsewhere / "plan.csv")
    # One movement is too few for labcrane power --recordings, which writes in this way.
    of_three = pd.DataFrame({"participant": PEOPLE, "movement_time": [1.0, 2.0, 3.0]})
    with simulate._written(elsewhere / "power", data, dict.fromkeys(PEOPLE, "")) as to:
        of_three.to_csv(to / "movements.csv", index=False)
    for name in PEOPLE:
        recording = data / name / f"{name}.h5"
        # As a command of a plugin writes.
        with written_about(recording, "a fit", elsewhere / f"fitted {name}.yaml") as path:
            path.write_text(
                f"# Fitted to session 1 of {name}.h5\noperator: {{}}\n", encoding="utf-8"
            )
        measures = ("--measures", elsewhere / f"replay_{name}.csv")
        command("replay", recording, "--run-recorded-code", *measures)
    if not any(map(missing, GRAPHICS)):
        shown = lab.folder / "shown.yaml"
        shown.write_text(f"{STUDY}{VIEW}", encoding="utf-8")
        for number, name in enumerate(PEOPLE):
            seen = ("--recording", data / name / f"{name}.h5", "--to", elsewhere / f"seen{number}")
            command("feedback", "preview", shown, *seen)
    _workbook(lab, data / "evaluation.xlsx")
    command("transfer", folder / "store", "--data", data)
    return lab


def _workbook(lab: Lab, path: Path) -> None:
    """Write what ``score`` writes of scenarios, which this study has none of."""
    with product(lab.places.root, "score", path.parent, PEOPLE, TODAY, whole=True) as made:
        write_workbook(_tests(), made.folder / path.name)
        write_csv(_tests(), made.folder / path.with_suffix(".csv").name)


def _tests() -> list[OperatorTest]:
    done = Performance(60.0, 1, 0, 0, 0, 0.5, 0.5, completed=True)
    made = indicate(done, 60.0, IndicatorSettings())
    return [
        OperatorTest(name, 1, 1, "doors", done, 60.0, "", made, IndicatorSettings())
        for name in PEOPLE
    ]


class Snapshot:
    """A folder that can be put back as it was, at the same path: registers hold paths."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._kept = folder.with_name(f"{folder.name}.kept")
        shutil.copytree(folder, self._kept, symlinks=True)

    def put_back(self) -> Lab:
        shutil.rmtree(self._folder)
        shutil.copytree(self._kept, self._folder, symlinks=True)
        lab = Lab.__new__(Lab)
        lab.folder = self._folder / "lab"
        lab.protocol = lab.folder / "study.yaml"
        lab.places = Places(lab.folder / "data")
        return lab


def opened(content: bytes) -> Iterator[str]:
    """Yield all texts in a file, unpacked by other means than labcrane's own proof."""
    yield content.decode("latin-1")
    yield content.replace(b"\x00", b"").decode("latin-1")
    if content[:2] == b"\x1f\x8b":
        yield from opened(gzip.decompress(content))
    elif content[:4] == b"PK\x03\x04":
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            for name in archive.namelist():
                yield name
                yield from opened(archive.read(name))
    elif content[:4] == b"\x89HDF":
        with h5py.File(io.BytesIO(content)) as file:
            names: list[str] = [f"{dict(file.attrs)}"]

            def look(name: str, node: h5py.HLObject) -> None:
                names.append(f"{name} {dict(node.attrs)}")
                if isinstance(node, h5py.Dataset) and node.dtype.kind in "OS":
                    names.append(str(node[()].tolist() if node.shape else node[()]))

            file.visititems(look)
            yield from names
    elif content[:4] == b"PAR1":
        yield parquet.read_table(io.BytesIO(content)).to_pandas().to_string()


def says(path: Path, name: str) -> bool:
    """Say whether a file, or its name, holds a pseudonym in any spelling, and not a longer one."""
    bare = name.replace("-", "")
    word = re.compile(rf"(?<![A-Za-z0-9])({name}|{bare})(?![0-9])")
    return any(word.search(text) for text in (str(path.name), *opened(path.read_bytes())))


def own(folder: Path, name: str) -> dict[str, str]:
    """Return the files that are one person's alone: in a folder or under a name of theirs."""
    bare = name.replace("-", "")
    word = re.compile(rf"(?<![A-Za-z0-9])({name}|{bare})(?![A-Za-z0-9])")
    # A report is worked out of everybody's data, pages and figures of one person too.
    return {
        path: sha
        for path, sha in files(folder).items()
        if word.search(path) and "report" not in path
    }


def killed_and_finished(
    snapshot: Snapshot,
    numbers: Sequence[int],
    work: Callable[[Lab], object],
    is_done: Callable[[Lab], bool],
    check: Callable[[Lab], None],
) -> int:
    """Kill ``work`` at each of these writes, finish it by the next call, and check.

    Returns how many calls were killed before one came to its end.
    """
    for killed, number in enumerate(numbers):
        if not _killed_and_finished(snapshot, number, work, is_done, check):
            return killed
    return len(numbers)


def _killed_and_finished(
    snapshot: Snapshot,
    number: int,
    work: Callable[[Lab], object],
    is_done: Callable[[Lab], bool],
    check: Callable[[Lab], None],
) -> bool:
    lab = snapshot.put_back()
    killed = killed_at(number, lambda: work(lab))
    if is_done(lab):
        recovery.move(lab.places, snapshot._folder / "store")
    else:
        work(lab)
    assert read(lab.places).work is None
    try:
        check(lab)
    except AssertionError as error:
        error.add_note(f"killed before write {number}")
        raise
    return killed
