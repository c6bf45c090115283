"""The command ``labcrane operator fit``."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from labcrane.participants import written_about

out = Console(soft_wrap=True, highlight=False)


def fit(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="a participant file")],
    session: Annotated[int, typer.Option(help="number of the session", min=1)] = 1,
    to: Annotated[
        Path | None, typer.Option("--out", help="YAML file for the protocol's key operator")
    ] = None,
) -> None:
    """Fit the simulated operator to a participant's aimed movements (95 % CIs)."""
    from labcrane_operator.fitted import not_identified, numbers, protocol_part, save
    from labcrane_operator.fitting import fit_operator
    from labcrane_operator.strokes import read_strokes

    strokes = read_strokes(recording, session)
    fitted = fit_operator(strokes)
    source = f"session {session} of {recording.name}, {len(strokes)} movements"
    table = Table(title=source)
    for column in ("setting", "value", "from", "to"):
        table.add_column(
            column, overflow="fold", justify="left" if column == "setting" else "right"
        )
    for name, estimate in fitted.items():
        table.add_row(name, *numbers(estimate))
    out.print(table)
    out.print("not identifiable from the recording, left at the default:")
    for name, why in not_identified(fitted).items():
        out.print(f"  {name}: {why}", markup=False)
    if to is not None:
        with written_about(recording, "operator fit", to) as beside:
            save(protocol_part(fitted, source), beside)
        out.print(f"operator: {to}", markup=False)
