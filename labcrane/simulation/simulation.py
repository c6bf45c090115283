"""A whole study without people: every session of every participant, as fast as it goes.

Nothing in the files depends on when, where or by which worker they were made: a participant who is
simulated again is the same to the last bit.
"""

import json
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path

from labcrane.analysis.parallel import work
from labcrane.core.records import Event, Run
from labcrane.design.plan import plan_session
from labcrane.errors import ProtocolError, RecordingError
from labcrane.files.atomic import make_folder, write_text
from labcrane.files.lock import alone_in
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study, load
from labcrane.recording.data_folder import DataFolder
from labcrane.recording.frame_log import BatchLog
from labcrane.registry.registry import discover
from labcrane.session.commands import Command, Order
from labcrane.session.sequencer import Sequencer
from labcrane.session.session import run
from labcrane.session.visit import Visit
from labcrane.simulation.fast_forward import FastForward, Way
from labcrane.simulation.population import read_population

ABOUT = "simulation.json"
WAY = "simulated_by.json"
"""In a participant's folder: by what each session was simulated, compiled twins or the loop."""

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
        Why the loop makes every tick; empty lets compiled twins make those that they can. The bits
        are the same.
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
    """A console at which nobody sits; the participant may leave in a trial."""

    def __init__(self, leaves_at: int | None) -> None:
        self._leaves_at = leaves_at
        self._orders: list[Command] = []
        self.left = False

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


def simulate(order: SimulationJob) -> DataFolder:
    """Simulate every session of one participant, and return the folder; a worker's function.

    A participant who is there already is left as they are.
    """
    if order.folder.path.exists():
        return order.folder
    study = load(order.protocol, discover(study=order.protocol))
    population = read_population(order.cohort, study)
    plan = plan_session(study, order.participant, 1)
    own = population.study_of(study, order.participant, plan.group)
    place = order.data / UNFINISHED
    make_folder(place)
    with tempfile.TemporaryDirectory(dir=place, prefix=f"{order.participant}-") as scratch:
        there = replace(order, data=Path(scratch)).folder
        ways: list[Way] = []
        for number in range(1, len(study.protocol.sessions) + 1):
            plan = plan_session(own, order.participant, number)
            attendance = Attendance(population.leaves_at(study, plan))
            visit = Visit(own, order.participant, number, Path(scratch), simulated=True, fast=True)
            ways.append(_run(visit, attendance, order.loop))
            if attendance.left:
                break
        write_text(there.path / WAY, json.dumps([asdict(way) for way in ways], indent=2) + "\n")
        _keep(there.path, order.folder.path)
    return order.folder


def _run(visit: Visit, attendance: Attendance, loop: str) -> Way:
    if loop:
        run(visit, attendance)
        return Way(compiled=False, why=loop)
    made: list[FastForward] = []

    def forward(rig: Rig, run: Run, sequencer: Sequencer, log: BatchLog) -> FastForward:
        made.append(FastForward(rig, run, sequencer, log, attendance.waiting))
        return made[-1]

    run(visit, attendance, forward)
    return made[-1].way


def _keep(done: Path, path: Path) -> None:
    try:
        done.rename(path)
    except OSError as error:
        if not path.exists():  # another worker was given the same participant, and was faster
            raise RecordingError(
                f"cannot put {path.name} into {path.parent}: {error.strerror}"
            ) from error


def simulate_study(
    orders: Sequence[SimulationJob], workers: int = 1, scheduler: str | None = None
) -> Iterator[DataFolder]:
    """Simulate the participants who are not there yet; yield each folder when it is finished.

    All orders are of one study and one data folder.

    Raises
    ------
    ProtocolError
        The folder holds another study, or another population's participants.
    """
    first = orders[0]
    study = load(first.protocol, discover(study=first.protocol))
    read_population(first.cohort, study)
    make_folder(first.data)
    with alone_in(first.data, wait=False):
        _check_same(first, study)
        shutil.rmtree(first.data / UNFINISHED, ignore_errors=True)
        short = _too_short(study, first.participant)
        jobs = [replace(order, loop=order.loop or short) for order in orders]
        missing = [order for order in jobs if not order.folder.path.exists()]
        yield from (order.folder for order in jobs if order not in missing)
        yield from work(simulate, missing, workers, scheduler)
        shutil.rmtree(first.data / UNFINISHED, ignore_errors=True)


def _too_short(study: Study, participant: str) -> str:
    """Return why the loop is sooner done than twins are loaded; empty when it is not.

    By all who are planned: who is simulated later must not be noted otherwise.
    """
    numbers = range(1, len(study.protocol.sessions) + 1)
    plans = [plan_session(study, participant, number) for number in numbers]
    seconds = sum(plan.expected_s for plan in plans) * study.protocol.participants.planned
    expected = round(seconds * study.protocol.rate_hz)
    if expected >= WORTH_LOADING:
        return ""
    return f"twins are loaded for {WORTH_LOADING:,} ticks or more, and {expected:,} are expected"


def _check_same(order: SimulationJob, study: Study) -> None:
    """Note what is simulated here; refuse to mix it with something else."""
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
