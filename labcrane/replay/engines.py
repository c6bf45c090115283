"""Engines compared: one session's input given to each, and how far apart what they move gets."""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import combinations
from pathlib import Path
from platform import processor, python_version, system
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from labcrane.core.records import Frame
from labcrane.errors import ProtocolError
from labcrane.files.html import rendered
from labcrane.files.yaml import read_yaml
from labcrane.recording.participant_file.reader import SessionRecord, open_recording
from labcrane.replay.replay import replay_session
from labcrane.replay.restore import restore
from labcrane.session.commands import QueueConsole
from labcrane.session.session import run
from labcrane.session.visit import Visit

if TYPE_CHECKING:
    import pandas as pd

    from labcrane.types import FloatArray

PARTICIPANT = "P001"
SHOWN_IN = {"rad": ("°", 180.0 / np.pi), "rad/s": ("°/s", 180.0 / np.pi), "m": ("mm", 1000.0)}
"""Units that people read, and how many there are in one of a record's."""


@dataclass(frozen=True, slots=True)
class Gap:
    """How far apart two engines are in one column of the state.

    Attributes
    ----------
    column, unit
        Which, and what the numbers are in.
    largest, rms
        Over all ticks that both have.
    span
        From the least to the largest value that the first of them had.
    """

    column: str
    unit: str
    largest: float
    rms: float
    span: float


@dataclass(frozen=True, slots=True)
class Driven:
    """One engine with the input of the session.

    Attributes
    ----------
    engine
        Its name in a protocol.
    state
        One row per tick.
    trials
        In which tick each trial ended, and how.
    median_ms, p99_ms
        What a tick took, all of it: scheme, crane, task and the check of each call.
    """

    engine: str
    state: "pd.DataFrame"
    trials: tuple[tuple[int, str], ...]
    median_ms: float
    p99_ms: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """Engines on the same input.

    Attributes
    ----------
    study, sha256
        The study's name, and the hash of its protocol.
    rate_hz, units
        Of the session; of the columns of its state.
    driven
        What each engine made of it.
    """

    study: str
    sha256: str
    rate_hz: float
    units: Mapping[str, str]
    driven: tuple[Driven, ...]

    def gaps(self, one: Driven, other: Driven) -> list[Gap]:
        """Return how far apart two of them are, column by column; what one lacks is left out."""
        found = []
        ticks = min(len(one.state), len(other.state))
        for column in map(str, one.state):
            if column not in other.state:
                continue
            unit, factor = SHOWN_IN.get(self.units[column], (self.units[column], 1.0))
            first, second = (
                factor * each.state[column].to_numpy(np.float64)[:ticks] for each in (one, other)
            )
            apart: FloatArray = np.abs(first - second)
            rms = float(np.sqrt(np.mean(apart**2)))
            found.append(Gap(column, unit, float(apart.max()), rms, float(np.ptp(first))))
        return found


def compare_engines(
    protocol: Path, engines: Sequence[str], *, participant: str = PARTICIPANT, session: int = 1
) -> Comparison:
    """Record a session by the simulated operator, and give its input to each engine.

    The operator is recorded with the study's own engine: what one engine does cannot change what
    another is asked to do.

    Raises
    ------
    ProtocolError
        The study or one of the engines cannot be run here, or fewer than two were named.
    """
    from labcrane.protocol.study import load  # noqa: PLC0415 - loads every part
    from labcrane.registry.registry import discover  # noqa: PLC0415 - as above

    if len(engines) < 2:  # noqa: PLR2004 - one alone has nothing to be compared with
        raise ProtocolError(
            f"a comparison needs two engines; {', '.join(engines) or 'none'} was named: "
            "--engines bullet_crane,mujoco_crane"
        )
    study = load(protocol, discover(study=protocol))
    study.check_installed(simulated=True, feedback=False)
    with TemporaryDirectory(prefix="labcrane-engines-") as folder:
        variants = Path(folder) / "study"
        variants.mkdir()
        visit = Visit(study, participant, session, Path(folder), simulated=True, fast=True)
        recording = run(visit, QueueConsole())
        record = open_recording(recording).session(session)
        paths = [_with_engine(engine, record, variants) for engine in engines]
        for path in paths:
            load(path, discover(study=path)).check_installed(simulated=True, feedback=False)
        driven = [
            _drive(engine, recording, session, path)
            for engine, path in zip(engines, paths, strict=True)
        ]
        units = dict(record.streams["state"].units)
    rate_hz = study.protocol.rate_hz
    return Comparison(study.protocol.study, study.sha256, rate_hz, units, tuple(driven))


def _with_engine(engine: str, record: SessionRecord, folder: Path) -> Path:
    """Write the recorded protocol with another engine, whose settings stay as they are."""
    content = read_yaml(
        restore(record, folder, None, None, run_code=True)
    )  # our own, just recorded
    content["dynamics"]["use"] = engine
    path = folder / f"{engine}.yaml"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def _drive(engine: str, recording: Path, session: int, protocol: Path) -> Driven:
    ended: list[tuple[int, str]] = []
    times: list[float] = []

    def note(frame: Frame) -> None:
        times.append(time.perf_counter())
        ended.extend(
            (frame.tick.number, str(event.data["outcome"]))
            for event in frame.events
            if event.name == "trial.end"
        )

    done = replay_session(recording, session, protocol=protocol, sinks=[note])
    took = 1000.0 * np.diff(times)
    median, p99 = np.percentile(took, [50, 99]).tolist()
    return Driven(engine, done.frames["state"], tuple(ended), median, p99)


def tables(comparison: Comparison) -> list[tuple[str, list[list[str]]]]:
    """Return the page's tables: a title, and rows of which the first has the names of columns."""
    costs = [["engine", "ticks", "median tick (ms)", "99 % of ticks within (ms)", "trials"]]
    for each in comparison.driven:
        counts = [str(len(each.state)), f"{each.median_ms:.3f}", f"{each.p99_ms:.3f}"]
        costs.append([each.engine, *counts, str(len(each.trials))])
    found = [("What a tick took", costs)]
    for one, other in combinations(comparison.driven, 2):
        rows = [["signal", "unit", "largest difference", "rms difference", "range"]]
        rows += [
            [gap.column, gap.unit, f"{gap.largest:.3g}", f"{gap.rms:.3g}", f"{gap.span:.4g}"]
            for gap in comparison.gaps(one, other)
        ]
        found.append((f"{one.engine} and {other.engine}", rows))
    return found


def sentences(comparison: Comparison) -> list[str]:
    """Return the sentences about the comparison for a Methods section."""
    names = " and ".join(each.engine for each in comparison.driven)
    first, *rest = comparison.driven
    same = all(each.trials == first.trials for each in rest)
    return [
        f"The input of one simulated session of {comparison.study} (protocol "
        f"{comparison.sha256[:12]}, {comparison.rate_hz:g} Hz, {len(first.state)} ticks) was given "
        f"to {names}.",
        "All trials ended in the same tick with the same outcome."
        if same
        else "Trials did not all end in the same tick with the same outcome.",
        f"labcrane {version('labcrane')}, Python {python_version()}, {system()} {processor()}.",
    ]


def as_markdown(comparison: Comparison) -> str:
    """Return the page as Markdown."""
    lines = ["# Engines compared", "", *sentences(comparison)]
    for title, (names, *rows) in tables(comparison):
        lines += ["", f"## {title}", "", _row(names), _row(["---"] * len(names))]
        lines += [_row(row) for row in rows]
    return "\n".join(lines) + "\n"


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def as_html(comparison: Comparison) -> str:
    """Return the page as HTML that needs nothing but itself."""
    page = Path(__file__).with_name("engines.html")
    return rendered(page, sentences=sentences(comparison), tables=tables(comparison))
