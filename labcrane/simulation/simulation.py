"""A whole study without people: every session of every participant, as fast as it goes.

Nothing in the files depends on when, where or by which worker they were made: a participant who is
simulated again is the same to the last bit.
"""

import json
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labcrane.analysis.measures import measures_of_trials
from labcrane.analysis.parallel import work
from labcrane.core.garbage import cleared
from labcrane.core.records import Event, Run, Value
from labcrane.design.plan import plan_session
from labcrane.errors import ProtocolError, RecordingError
from labcrane.files.atomic import give_name, make_folder, write_text
from labcrane.files.lock import alone_in
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study, load
from labcrane.recording.data_folder import DataFolder
from labcrane.recording.frame_log import BatchLog
from labcrane.registry.registry import discover
from labcrane.session.commands import Command, Order
from labcrane.session.sequencer import Sequencer
from labcrane.session.session import ForwardMaker, record, run
from labcrane.session.visit import Visit
from labcrane.simulation.fast_forward import FastForward, SimulatedBy
from labcrane.simulation.population import read_population

if TYPE_CHECKING:
    import pandas as pd

ABOUT = "simulation.json"
TRIALS = "_trials.parquet"
"""Behind a participant's name: a file of the trial table alone."""

COUNTED = "counted"
"""Column that tells whether a trial counts; the trial table has only trials that do."""

WAY = "simulated_by.json"
"""In a participant's folder: how each session was simulated, by compiled kernels or the loop."""

WORTH_LOADING = 200_000
"""Ticks of a simulation for which the loop takes longer than numba to load, about ten seconds."""

UNFINISHED = ".unfinished"
"""Where participants are until all their sessions are done; what a killed worker leaves there is
thrown away."""


@dataclass(frozen=True, slots=True)
class SimulationJob:
    """One participant to be simulated, by the names of things, so that it can be sent.

    Attributes
    ----------
    protocol, cohort
        The study's file and the population's; without one all operators are alike.
    data
        Where the participants' folders go.
    loop
        Why the loop computes every tick; empty lets compiled kernels compute those that they can.
        The bits are the same.
    """

    protocol: Path
    cohort: Path | None
    data: Path
    participant: str
    loop: str = ""

    @property
    def folder(self) -> DataFolder:
        """Where the participant is recorded."""
        return DataFolder(self.data, self.participant, pilot=False, simulated=True)


class Attendance:
    """A console without a person; the participant may leave in a trial.

    Attributes
    ----------
    left
        Whether they have left.
    rows
        The trial table so far.
    """

    def __init__(self, leaves_at: int | None) -> None:
        self._leaves_at = leaves_at
        self._orders: list[Command] = []
        self.left = False
        self.rows: list[Mapping[str, Value]] = []

    def waiting(self) -> bool:
        """Whether an order is still to be taken."""
        return bool(self._orders)

    def commands(self) -> list[Command]:
        given, self._orders = self._orders, []
        return given

    def report(self, event: Event) -> None:
        if event.name == "trial.start" and event.data["trial"] == self._leaves_at:
            self.left = True
            self._orders = [Command(Order.END, "the simulated participant leaves")]
        elif event.name == "trial.end" and event.data[COUNTED]:
            self.rows.append(event.data)


def simulate(order: SimulationJob) -> DataFolder:
    """Simulate every session of one participant, and return the folder; a worker's function.

    A participant who is there already is left as they are.
    """
    if order.folder.path.exists():
        return order.folder
    place = order.data / UNFINISHED
    make_folder(place)
    own = tempfile.TemporaryDirectory(dir=place, prefix=f"{order.participant}-")
    with cleared(), own as scratch:
        there = replace(order, data=Path(scratch)).folder
        ways = [_run(run, *each, order.loop) for each in visits(order, Path(scratch))]
        write_text(there.path / WAY, json.dumps([asdict(way) for way in ways], indent=2) + "\n")
        _keep(there.path, order.folder.path)
    return order.folder


def simulate_trials(order: SimulationJob) -> "pd.DataFrame":
    """Simulate every session of one participant, and return the trial table; a worker's function.

    Nothing is left but the table, in one small file that a later call returns: no participant file
    is made, and nothing is measured in frames. Its columns are those of the participant file, and
    :data:`~labcrane.analysis.measures.OF_TRIALS`.
    """
    import pandas as pd

    path = order.data / f"{order.folder.name}{TRIALS}"
    if path.exists():
        return pd.read_parquet(path)
    tables, left = [], False
    own = tempfile.TemporaryDirectory(prefix=f"labcrane-{order.participant}-")
    with cleared(), own as scratch:
        for visit, attendance in visits(order, Path(scratch)):
            _run(_record, visit, attendance, order.loop)
            tables.append(_table(visit, attendance.rows))
            left = attendance.left
    table = pd.concat(tables, ignore_index=True)
    table.insert(1, "status", "half-finished" if left else "simulated")
    make_folder(order.data)
    with tempfile.TemporaryDirectory(dir=order.data, prefix=UNFINISHED) as scratch:
        table.to_parquet(Path(scratch) / path.name)
        give_name(Path(scratch) / path.name, path)
    return table


def _table(visit: Visit, rows: "Sequence[Mapping[str, Value]]") -> "pd.DataFrame":
    """Return rows as a participant file has them: numbers as they are, truth values as 0 and 1."""
    import pandas as pd

    columns = list(dict.fromkeys(name for row in rows for name in row if name != COUNTED))
    table = pd.DataFrame(index=range(len(rows)))
    for name in columns:
        values = [row.get(name) for row in rows]
        if any(isinstance(value, str) for value in values):
            table[name] = ["" if value is None else str(value) for value in values]
        else:
            table[name] = np.array([np.nan if v is None else v for v in values], np.float64)
    table = measures_of_trials(table) if rows else table
    table.insert(0, "participant", visit.folder.name)
    table.insert(1, "session", visit.session)
    table.insert(2, "session_name", visit.study.protocol.sessions[visit.session - 1].name)
    return table


def visits(order: SimulationJob, data: Path) -> Iterator[tuple[Visit, Attendance]]:
    """Yield a participant's sessions, until they leave, each to be run before the next is asked."""
    study = load(order.protocol, discover(study=order.protocol))
    population = read_population(order.cohort, study)
    plan = plan_session(study, order.participant, 1)
    own = population.study_of(study, order.participant, plan.group)
    for number in range(1, len(study.protocol.sessions) + 1):
        plan = plan_session(own, order.participant, number)
        attendance = Attendance(population.leaves_at(study, plan))
        yield (
            Visit(own, order.participant, number, data, simulated=True, fast=True),
            attendance,
        )
        if attendance.left:
            break


Runner = Callable[[Visit, Attendance, ForwardMaker | None], object]
"""Runs a session, to its participant file or not."""


def _record(visit: Visit, attendance: Attendance, forward: ForwardMaker | None) -> None:
    record(visit, attendance, forward=forward)


def _run(runner: Runner, visit: Visit, attendance: Attendance, loop: str) -> SimulatedBy:
    if loop:
        runner(visit, attendance, None)
        return SimulatedBy(compiled=False, why=loop)
    made: list[FastForward] = []

    def forward(rig: Rig, run: Run, sequencer: Sequencer, log: BatchLog) -> FastForward:
        made.append(FastForward(rig, run, sequencer, log, attendance.waiting))
        return made[-1]

    runner(visit, attendance, forward)
    return made[-1].way


def _keep(done: Path, path: Path) -> None:
    try:
        give_name(done, path)
    except OSError as error:
        if not path.exists():  # another worker was given the same participant, and was faster
            raise RecordingError(
                f"cannot put {path.name} into {path.parent}: {error.strerror}"
            ) from error


def simulate_study(
    orders: Sequence[SimulationJob], workers: int | None = 1, scheduler: str | None = None
) -> Iterator[DataFolder]:
    """Simulate the participants who are not there yet; yield each folder when it is finished.

    All orders are of one study and one data folder.

    Raises
    ------
    ProtocolError
        The folder holds another study, or another population's participants.
    """
    with _ready(orders) as jobs:
        missing = [order for order in jobs if not order.folder.path.exists()]
        yield from (order.folder for order in jobs if order not in missing)
        yield from work(simulate, missing, workers, scheduler)


def simulate_tables(
    orders: Sequence[SimulationJob], workers: int | None = 1, scheduler: str | None = None
) -> "Iterator[pd.DataFrame]":
    """Simulate the participants and yield their trial tables, in the order in which they are done.

    As :func:`simulate_study`, by :func:`simulate_trials`.
    """
    with _ready(orders) as jobs:
        yield from work(simulate_trials, jobs, workers, scheduler)


@contextmanager
def _ready(orders: Sequence[SimulationJob]) -> Iterator[list[SimulationJob]]:
    """Hold a data folder for one study's simulation; give the orders, with by what they are run."""
    first = orders[0]
    study = load(first.protocol, discover(study=first.protocol))
    read_population(first.cohort, study)
    make_folder(first.data)
    with alone_in(first.data, wait=False):
        _check_same(first, study)
        _sweep(first.data)
        short = _too_short(study, first.participant)
        yield [replace(order, loop=order.loop or short) for order in orders]
        _sweep(first.data)


def _sweep(data: Path) -> None:
    for left in data.glob(f"{UNFINISHED}*"):
        shutil.rmtree(left, ignore_errors=True)


def _too_short(study: Study, participant: str) -> str:
    """Return why the loop is faster than loading compiled kernels; empty when it is not.

    By all who are planned: who is simulated later must not be noted otherwise.
    """
    numbers = range(1, len(study.protocol.sessions) + 1)
    plans = [plan_session(study, participant, number) for number in numbers]
    seconds = sum(plan.expected_s for plan in plans) * study.protocol.participants.planned
    expected = round(seconds * study.protocol.rate_hz)
    if expected >= WORTH_LOADING:
        return ""
    return (
        f"compiled kernels are loaded for {WORTH_LOADING:,} ticks or more, and {expected:,} are "
        "expected"
    )


def _check_same(order: SimulationJob, study: Study) -> None:
    """Note the simulation in this folder; refuse to mix it with another."""
    cohort = order.cohort.read_text(encoding="utf-8") if order.cohort else None
    about = {
        "status": "SIMULATED",
        "labcrane": version("labcrane"),
        "study": study.protocol.study,
        "protocol_sha256": study.sha256,
        "cohort": cohort,
    }
    path = order.data / ABOUT
    if not path.exists():
        write_text(path, json.dumps(about, indent=2) + "\n")
        return
    there = json.loads(path.read_text(encoding="utf-8"))
    if different := [name for name in about if about[name] != there.get(name)]:
        raise ProtocolError(
            f"{order.data} holds a simulation with another {', '.join(different)}; give a new "
            "folder with --out"
        )
