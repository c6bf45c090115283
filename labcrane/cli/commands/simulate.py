"""Commands that rehearse a study without people: simulate and power."""

from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from labcrane.cli.commands.results import (
    Include,
    Scheduler,
    WorkersOrCores,
    cohort_of,
    progress_bar,
)
from labcrane.cli.options import ProtocolHere, stay_on_this_computer, study_of
from labcrane.cli.output import out

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from labcrane.analysis.cohort import Participant
    from labcrane.protocol.study import Study
    from labcrane.simulation.power import Claim, Effect, Power
    from labcrane.simulation.reported import Kind
    from labcrane.simulation.sample_size import SampleSize
    from labcrane.simulation.simulation import SimulationJob

CohortPath = Annotated[
    Path | None,
    typer.Option(help="how operators differ; by default cohort.yaml in the protocol's folder"),
]


def simulate(
    protocol: ProtocolHere,
    folder: Annotated[Path, typer.Option("--out", help="the simulated study's data folder")],
    participants: Annotated[
        int | None,
        typer.Option(help="number of participants; the planned number by default", min=1),
    ] = None,
    cohort: CohortPath = None,
    workers: WorkersOrCores = None,
    scheduler: Scheduler = None,
) -> None:
    """Run a whole study with simulated operators, as fast as possible.

    Participants who are in the folder already are kept: an interrupted run continues.
    """
    from labcrane.files.pseudonyms import pseudonyms

    study = study_of(protocol)
    count = participants or study.protocol.participants.planned
    names = pseudonyms(study.protocol.participants.pattern, count)
    simulate_all(protocol, folder, names, cohort, workers, scheduler)
    out.print(f"SIMULATED: {count} participants in {folder}", markup=False)


def simulate_all(
    protocol: Path,
    folder: Path,
    names: "Sequence[str]",
    cohort: Path | None,
    workers: int | None,
    scheduler: str | None,
) -> None:
    """Simulate the participants who are not in ``folder`` yet, and report progress."""
    from labcrane.simulation.simulation import simulate_study

    orders = _orders(protocol, folder, names, cohort)
    try:
        with progress_bar("simulate", len(orders)) as advance:
            for _ in simulate_study(orders, workers, scheduler):
                advance()
    except KeyboardInterrupt:
        there = sum(order.folder.path.exists() for order in orders)
        out.print(
            f"interrupted: {there} of {len(orders)} participants are complete in {folder}; run the "
            "same command to simulate the others",
            markup=False,
        )
        raise


def _orders(
    protocol: Path, folder: Path, names: "Sequence[str]", cohort: Path | None
) -> "list[SimulationJob]":
    """Return the participants to simulate, and print which operators are used."""
    from labcrane.files.names import COHORT
    from labcrane.simulation.simulation import SimulationJob

    stay_on_this_computer()
    beside = protocol.resolve().with_name(COHORT)
    cohort = cohort or (beside if beside.exists() else None)
    out.print(f"operators: {cohort or 'identical except for their seeds'}", markup=False)
    # Workers may be in another folder than we are.
    place = folder.resolve()
    of = cohort.resolve() if cohort else None
    return [SimulationJob(protocol.resolve(), of, place, name) for name in names]


POOL_TIMES = 5
"""Size of the simulated pool, in multiples of the largest cohort."""


def power(
    protocol: ProtocolHere,
    folder: Annotated[Path, typer.Option("--out", help="for the pool, the table and the plot")],
    participants: Annotated[str, typer.Option(help="sizes of the cohort")] = "12,24,36,48",
    effect: Annotated[
        str, typer.Option(help="the test: MEASURE~FACTOR; =SIZE imposes an effect")
    ] = "movement_time~sequence",
    test: Annotated[
        str,
        typer.Option(help="t, or one of the report's tests: anova, contrast, trend or mixed"),
    ] = "t",
    pool: Annotated[
        int | None,
        typer.Option(
            help="size of the pool to sample from; by default five times the largest", min=3
        ),
    ] = None,
    recordings: Annotated[
        Path | None,
        typer.Option(help="sample from the participants in this data folder; no simulation"),
    ] = None,
    include: Include = None,
    cohorts: Annotated[int, typer.Option(help="cohorts sampled for each size", min=20)] = 1000,
    resimulate: Annotated[
        int | None, typer.Option(help="simulate this many new cohorts instead of sampling", min=2)
    ] = None,
    claim: Annotated[
        str, typer.Option(help="hypothesis: difference, equivalence or non_inferiority")
    ] = "difference",
    margin: Annotated[
        float, typer.Option(help="margin of equivalence or non-inferiority, in the effect's unit")
    ] = 0.0,
    goal: Annotated[
        str, typer.Option(help="find the smallest cohort for these powers: 0.8,0.9")
    ] = "",
    cohort: CohortPath = None,
    workers: WorkersOrCores = None,
    scheduler: Scheduler = None,
) -> None:
    """Estimate the planned test's power and sample size, from simulated or recorded participants.

    Without --test it is a t test of the participants' slopes, or differences, against zero; Welch's
    between groups. With permuted labels it estimates the rate of false positives.
    """
    from labcrane.analysis.quality import is_result
    from labcrane.errors import ProtocolError
    from labcrane.files.pseudonyms import pseudonyms
    from labcrane.simulation.power import read_effect

    tested, to_show, goals = read_effect(effect), _claim(claim, margin), _goals(goal)
    sizes = _sizes(participants)
    study = study_of(protocol)
    if resimulate is not None and (recordings is not None or test != "t"):
        raise ProtocolError(
            "--resimulate is for the t test of new participants; it cannot be combined with "
            "--recordings or --test; drop it"
        )
    kind = _kind(test)
    if recordings is not None:
        everyone = _recorded(recordings, include, workers, scheduler)
    else:
        count = pool or POOL_TIMES * max(sizes)
        if resimulate is not None:
            count, cohorts = resimulate * max(sizes), resimulate
        names = pseudonyms(study.protocol.participants.pattern, count)
        everyone = _simulated(
            protocol, folder / "pool", names, cohort, study, tested, workers, scheduler
        )
    by = _Drawn(study.protocol.study, sizes, cohorts, to_show, recordings is not None, folder)
    with _written(folder, recordings, everyone.people) as to:
        movements = everyone.movements
        if kind is not None:
            movements.to_csv(to / "movements.csv", index=False)
            _power_of_report(to, everyone, tested, effect, kind, goals, by, workers, scheduler)
            return
        movements[is_result(movements)].to_csv(to / "movements.csv", index=False)
        _print_power(to, by, everyone, tested, fresh=resimulate is not None)
        if goals:
            _search(to, by, everyone, effect, goals)


@contextmanager
def _written(
    folder: Path, recordings: Path | None, people: "Mapping[str, str]"
) -> "Iterator[Path]":
    """Hand out the output folder; output from recordings is personal data, and is registered."""
    from labcrane.cli.commands.approval import today
    from labcrane.files.atomic import make_folder
    from labcrane.participants.products import product

    if recordings is None:
        make_folder(folder)
        yield folder
        return
    with product(recordings, "power", folder, sorted(people), today(), whole=True) as made:
        yield made.folder


@dataclass(frozen=True)
class _Everyone:
    """The pool of cohorts: movements, and the group of everyone, even without movements."""

    movements: "pd.DataFrame"
    people: "Mapping[str, str]"


@dataclass(frozen=True)
class _Drawn:
    """How cohorts are sampled, the tested claim, and the final place of the files."""

    study: str
    sizes: "Sequence[int]"
    cohorts: int
    claim: "Claim"
    recorded: bool
    shown: Path


def _kind(test: str) -> "Kind | None":
    """Return the requested test of the report; None for the t test."""
    from typing import cast, get_args

    from labcrane.errors import ProtocolError, suggestion
    from labcrane.simulation.reported import Kind

    kinds = ("t", *get_args(Kind))
    if test not in kinds:
        raise ProtocolError(f"--test {test!r} is not a test; {suggestion(test, kinds)}")
    return None if test == "t" else cast("Kind", test)


def _simulated(
    protocol: Path,
    folder: Path,
    names: "Sequence[str]",
    cohort: Path | None,
    study: "Study",
    effect: "Effect",
    workers: int | None,
    scheduler: str | None,
) -> _Everyone:
    """Return a simulated pool; files are made only where frames are asked for."""
    from labcrane.analysis.measures import OF_TRIALS
    from labcrane.approval.codebook import codebook
    from labcrane.design.plan import plan_session
    from labcrane.recording.data_folder import DataFolder
    from labcrane.simulation.simulation import simulate_tables

    people = {
        DataFolder(folder, name, pilot=False, simulated=True).name: plan_session(
            study, name, 1
        ).group
        for name in names
    }
    there = {each.name for each in codebook(study) if each.table == "trials"} | {*OF_TRIALS}
    if effect.measure not in there:
        simulate_all(protocol, folder, names, cohort, workers, scheduler)
        return _movements(folder, people, workers, scheduler)
    orders = _orders(protocol, folder, names, cohort)
    with progress_bar("simulate", len(orders)) as advance:
        tables = []
        for table in simulate_tables(orders, workers, scheduler):
            tables.append(table)
            advance()
    return _together(tables, people)


def _recorded(
    folder: Path, include: "list[str] | None", workers: int | None, scheduler: str | None
) -> _Everyone:
    """Return the included participants of a data folder."""
    cohort = cohort_of(folder.resolve() if scheduler else folder, include)
    people = {each.name: str(each.context.get("group", "")) for each in cohort.included}
    return _measured(cohort.included, people, workers, scheduler)


def _power_of_report(
    folder: Path,
    everyone: _Everyone,
    effect: "Effect",
    written: str,
    kind: "Kind",
    goals: "Sequence[float]",
    by: _Drawn,
    workers: int | None,
    scheduler: str | None,
) -> None:
    from labcrane.design.seeds import derive
    from labcrane.files.atomic import write_text
    from labcrane.simulation.power import Power
    from labcrane.simulation.reported import NAMES, plan_test, power_of_report
    from labcrane.simulation.sample_size import paragraph, smallest_cohort

    planned = plan_test(kind, effect, everyone.movements, by.claim, everyone.people)
    seed = derive(by.study, "power")

    def power_at(size: int) -> Power:
        (one,) = power_of_report(planned, [size], by.cohorts, seed, by.claim, workers, scheduler)
        return one

    with progress_bar("test", len(by.sizes)) as advance:
        found = []
        for size in by.sizes:
            found.append(power_at(size))
            advance()
    _write_power(folder, found, by)
    if goals:
        searched = [smallest_cohort(power_at, goal) for goal in goals]
        people = len(everyone.people)
        text = paragraph(
            written, by.claim, people, searched, test=NAMES[kind], recorded=by.recorded
        )
        _print_sizes(searched)
        write_text(folder / "sample_size.md", text + "\n")
        out.print(f"for the ethics application: {by.shown / 'sample_size.md'}", markup=False)


def _claim(kind: str, margin: float) -> "Claim":
    from typing import cast, get_args, get_type_hints

    from labcrane.errors import ProtocolError, suggestion
    from labcrane.simulation.power import Claim

    kinds = get_args(get_type_hints(Claim)["kind"])
    if kind not in kinds:
        raise ProtocolError(f"--claim {kind!r} is not a hypothesis; {suggestion(kind, kinds)}")
    return Claim(cast("Any", kind), margin)


def _goals(text: str) -> list[float]:
    from labcrane.errors import ProtocolError

    try:
        return [float(word) for word in text.split(",") if word]
    except ValueError:
        raise ProtocolError(f"--goal {text!r} is not a list of powers; write 0.8,0.9") from None


def _search(
    folder: Path, by: _Drawn, everyone: _Everyone, effect: str, goals: "Sequence[float]"
) -> None:
    from labcrane.design.seeds import derive
    from labcrane.files.atomic import write_text
    from labcrane.simulation.power import make_pool, read_effect
    from labcrane.simulation.sample_size import paragraph, sample_size

    tested = read_effect(effect)
    pool = make_pool(everyone.movements, tested, everyone.people)
    seed = derive(by.study, "sample size")
    found = [sample_size(pool, tested, goal, by.cohorts, seed, by.claim) for goal in goals]
    _print_sizes(found)
    text = paragraph(effect, by.claim, len(pool.means), found, recorded=by.recorded)
    write_text(folder / "sample_size.md", text + "\n")
    out.print(f"for the ethics application: {by.shown / 'sample_size.md'}", markup=False)


def _print_sizes(found: "Sequence[SampleSize]") -> None:
    from labcrane.simulation.sample_size import far_end

    for each in found:
        ends = f"{each.low} to {far_end(each)}"
        out.print(f"power {each.goal:g}: {each.participants} participants ({ends})", markup=False)


def _sizes(text: str) -> list[int]:
    from labcrane.errors import ProtocolError

    try:
        sizes = sorted({int(word) for word in text.split(",")})
    except ValueError:
        sizes = []
    if not sizes or sizes[0] < 3:  # noqa: PLR2004 - a t test with fewer says nothing
        raise ProtocolError(
            f"--participants {text!r} is not a list of sizes of 3 or more; write 12,24,36"
        )
    return sizes


def _movements(
    folder: Path, people: "Mapping[str, str]", workers: int | None, scheduler: str | None
) -> _Everyone:
    """Return the participants of a pool, who may be more in its folder."""
    from labcrane.analysis.cohort import find_cohort

    there = find_cohort(folder.resolve(), ["simulated", "half-finished"]).included
    wanted = [person for person in there if person.name in people]
    return _measured(wanted, people, workers, scheduler)


def _measured(
    there: "Sequence[Participant]",
    people: "Mapping[str, str]",
    workers: int | None,
    scheduler: str | None,
) -> _Everyone:
    from labcrane.analysis.measures import measures_of
    from labcrane.analysis.parallel import work

    with progress_bar("measure", len(there)) as advance:
        tables = []
        for table in work(measures_of, there, workers, scheduler):
            tables.append(table)
            advance()
    return _together(tables, people)


def _together(tables: "Sequence[pd.DataFrame]", people: "Mapping[str, str]") -> _Everyone:
    """Return all movements in one table, and print who has none."""
    import pandas as pd

    everything = pd.concat(tables, ignore_index=True)
    there = set() if everything.empty else set(everything["participant"])
    if missing := [name for name in people if name not in there]:
        out.print(
            f"without a counted movement: {', '.join(missing)}; they are sampled like the "
            "others, but are in no test",
            markup=False,
        )
    if not everything.empty:
        everything = everything.sort_values("participant", kind="stable", ignore_index=True)
    return _Everyone(everything, people)


def _print_power(
    folder: Path, by: _Drawn, everyone: _Everyone, tested: "Effect", *, fresh: bool
) -> None:
    from labcrane.design.seeds import derive
    from labcrane.simulation.power import make_pool
    from labcrane.simulation.power import power as power_of

    pool = make_pool(everyone.movements, tested, everyone.people)
    there = set(everyone.movements["participant"])  # the others were reported before
    if left_out := [name for name in pool.left_out if name in there]:
        out.print(
            f"without a value at some level: {', '.join(left_out)}; they are sampled like "
            "the others, but left out of the test",
            markup=False,
        )
    seed = derive(by.study, "power")
    found = power_of(pool, tested, by.sizes, by.cohorts, seed, fresh=fresh, claim=by.claim)
    _write_power(folder, list(found), by)


def _write_power(folder: Path, found: "Sequence[Power]", by: _Drawn) -> None:
    from dataclasses import asdict

    import pandas as pd

    from labcrane.analysis.report.figures import power_curve
    from labcrane.cli.output import whole_table

    table = whole_table(
        "participants", "cohorts", "power", "95 %", "in nothing", "type M", "type S"
    )
    for one in found:
        table.add_row(
            str(one.participants),
            str(one.cohorts),
            f"{one.power:.3f}",
            f"{one.power_low:.3f} to {one.power_high:.3f}",
            f"{one.null:.3f}",
            f"{one.type_m:.2f}",
            f"{one.type_s:.3f}",
        )
    out.print(table)
    curve = pd.DataFrame([asdict(one) for one in found])
    curve.to_csv(folder / "power.csv", index=False)
    whose = "drawn from recordings" if by.recorded else "simulated operators"
    power_curve(curve, whose).savefig(folder / "power.png", dpi=150)
    stamp = "DRAWN FROM RECORDINGS" if by.recorded else "SIMULATED"
    out.print(f"{stamp}: {by.shown / 'power.csv'}, power.png, movements.csv", markup=False)
