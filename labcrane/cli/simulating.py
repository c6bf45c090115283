"""Commands that rehearse a study without people: simulate and power."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.cli.inspect import ProtocolPath, out
from labcrane.cli.network import stay_on_this_computer
from labcrane.cli.results import progress_bar

if TYPE_CHECKING:
    from collections.abc import Sequence

CohortPath = Annotated[
    Path | None,
    typer.Option(help="how operators differ; cohort.yaml beside the protocol if there is one"),
]
Workers = Annotated[int, typer.Option(help="processes on this computer", min=1)]
Scheduler = Annotated[
    str | None, typer.Option(help="a Dask scheduler whose workers do it: tcp://host:8786")
]


def simulate(
    protocol: ProtocolPath,
    folder: Annotated[Path, typer.Option("--out", help="the simulated study's data folder")],
    participants: Annotated[
        int | None, typer.Option(help="how many; as many as are planned by default", min=1)
    ] = None,
    cohort: CohortPath = None,
    workers: Workers = 1,
    scheduler: Scheduler = None,
) -> None:
    """Run a whole study with simulated operators, as fast as it goes.

    Participants who are in the folder already are kept: what was interrupted goes on.
    """
    from labcrane.pseudonyms import pseudonyms
    from labcrane.registry import discover
    from labcrane.study import load

    study = load(protocol, discover(study=protocol))
    count = participants or study.protocol.participants.planned
    names = pseudonyms(study.protocol.participants.pattern, count)
    simulate_all(protocol, folder, names, cohort, workers, scheduler)
    out.print(f"SIMULATED: {count} participants in {folder}", markup=False)


def simulate_all(
    protocol: Path,
    folder: Path,
    names: "Sequence[str]",
    cohort: Path | None,
    workers: int,
    scheduler: str | None,
) -> None:
    """Simulate whoever is not in ``folder`` yet, and say how far it is."""
    from labcrane.population import BESIDE
    from labcrane.simulation import SimulationOrder, simulate_study

    stay_on_this_computer()
    beside = protocol.resolve().with_name(BESIDE)
    cohort = cohort or (beside if beside.exists() else None)
    out.print(f"operators: {cohort or 'all alike but for their seeds'}", markup=False)
    # Workers may be in another folder than we are.
    place = folder.resolve()
    of = cohort.resolve() if cohort else None
    orders = [SimulationOrder(protocol.resolve(), of, place, name) for name in names]
    with progress_bar("simulate", len(orders)) as advance:
        for _ in simulate_study(orders, workers, scheduler):
            advance()
