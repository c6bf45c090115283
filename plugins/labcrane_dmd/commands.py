"""The commands ``labcrane dmd fit``, ``validate`` and ``plot``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from pydantic import ValidationError
from rich.console import Console
from rich.table import Table

from labcrane import ProtocolError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from labcrane_dmd.fit.recordings import SegmentRecording
    from labcrane_dmd.fit.validation import Level
    from labcrane_dmd.model.model import Model

RecordingsPath = Annotated[
    Path, typer.Argument(metavar="RECORDINGS", help="a CSV file of a segment, or a folder of them")
]
ModelPath = Annotated[Path, typer.Argument(metavar="MODEL", help="a model's YAML file")]

out = Console(soft_wrap=True, highlight=False)


def _table(*columns: str, title: str | None = None) -> Table:
    """Return a table in which nothing is cut off."""
    made = Table(title=title)
    for column in columns:
        made.add_column(column, overflow="fold")
    return made


def fit(
    recordings: RecordingsPath,
    to: Annotated[Path, typer.Option("--out", help="the model's YAML file")],
    between: Annotated[
        Literal["linear", "pchip"], typer.Option(help="how speeds between layers are found")
    ] = "linear",
    max_degree: Annotated[
        int, typer.Option(help="largest degree of the polynomials", min=1, max=12)
    ] = 9,
    levels: Annotated[
        str | None, typer.Option(help="signals of the layers: 40,80,120; the paper's by default")
    ] = None,
    validation: Annotated[
        str | None, typer.Option(help="signals that the fit does not use: 20,60,100")
    ] = None,
    edge: Annotated[
        str | None,
        typer.Option(help="further signals for the edge of the dead band; '' for none"),
    ] = None,
    dead_band: Annotated[
        Literal["found", "none"],
        typer.Option(help="none: speed rises from signal 0, as in the paper"),
    ] = "found",
) -> None:
    """Make a Dynamic Model Description from recordings of joints."""
    from labcrane_dmd.fit.fitting import fit_model
    from labcrane_dmd.fit.recordings import read_recordings
    from labcrane_dmd.model.model_file import save
    from labcrane_dmd.model.settings import FitSettings

    given = {"levels": levels, "validation": validation, "edge": edge}
    signals = {name: _signals(name, text) for name, text in given.items() if text is not None}
    try:
        settings = FitSettings.model_validate(
            {
                "between": between,
                "max_degree": max_degree,
                "dead_band": dead_band,
                **signals,
            }
        )
    except ValidationError as error:
        raise ProtocolError(str(error.errors()[0]["msg"]).removeprefix("Value error, ")) from None
    model = fit_model(read_recordings(recordings), settings)
    save(model, to)
    table = _table("segment", "direction", "dead band", "dead time", "lag", "degrees", "not whole")
    for name, segment in model.items():
        for direction, what in ((segment.extend, "extend"), (segment.retract, "retract")):
            table.add_row(
                name,
                what,
                f"{direction.dead_band:.1f}",
                f"{1000 * direction.dead_time:.0f} ms",
                f"{1000 * direction.lag:.0f} ms",
                " ".join(str(max(len(layer.coefficients) - 1, 0)) for layer in direction.layers),
                " ".join(f"{layer.signal:g}" for layer in direction.layers if not layer.whole),
            )
    out.print(table)
    out.print(f"model: {to}", markup=False)


def _signals(name: str, text: str) -> tuple[int, ...]:
    """Return the signals of a list with commas."""
    try:
        found = tuple(int(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise ProtocolError(
            f"--{name} {text!r} is not a list of signals; write whole numbers with commas: "
            "40,80,120"
        ) from None
    if wrong := [signal for signal in found if signal <= 0]:
        raise ProtocolError(
            f"--{name} has {wrong[0]}; write sizes above 0, each is used in both directions"
        )
    return found


def validate(
    model: ModelPath,
    recordings: RecordingsPath,
    to: Annotated[Path | None, typer.Option("--out", help="folder for tables and figures")] = None,
    between: Annotated[
        Literal["linear", "pchip"] | None,
        typer.Option(help="another rule between layers than the model's own"),
    ] = None,
    *,
    drive: Annotated[
        bool,
        typer.Option(help="drive every segment of the simulated arm through the engine's steps"),
    ] = False,
    machine: Annotated[
        str | None, typer.Option(help="with --drive: the machine, or its YAML file")
    ] = None,
    rate_hz: Annotated[float, typer.Option(help="with --drive: steps per second", min=20)] = 240.0,
) -> None:
    """Compare a model with recordings at signals that it was not fitted to, and at 0.

    Tables and figures for the other rule between layers are saved beside those of the model's own.
    """
    from labcrane_dmd.fit.figures import draw_validation
    from labcrane_dmd.fit.recordings import read_recordings
    from labcrane_dmd.fit.validation import summary, write_table
    from labcrane_dmd.fit.validation import validate as compare
    from labcrane_dmd.model.model_file import load
    from labcrane_dmd.model.output import written

    if drive and machine is None:
        raise ProtocolError(
            "--drive moves the segments of a machine; name the machine: --machine ied_arm.yaml"
        )
    if machine is not None and not drive:
        raise ProtocolError(f"--machine {machine} is only driven with --drive; add it")
    loaded = load(model, between)
    folder = to or model.with_suffix("").with_name(f"{model.stem}-validation")
    with written(folder):
        folder.mkdir(parents=True, exist_ok=True)
    read = read_recordings(recordings)
    own = loaded.settings.between
    for rule in ("linear", "pchip"):
        levels = compare(loaded.interpolated(rule), read)
        ending = "" if rule == own else f"_{rule}"
        write_table((level.row() for level in levels), folder / f"validation{ending}.csv")
        write_table(summary(levels), folder / f"summary{ending}.csv")
        draw_validation(levels, rule, folder / f"validation{ending}.png")
        _print(levels, rule)
    if drive and machine is not None:
        _drive(loaded, model, machine, read, rate_hz, folder)
    out.print(f"tables and figures: {folder}", markup=False)


def _drive(
    model: "Model",
    file: Path,
    machine: str,
    recordings: "Sequence[SegmentRecording]",
    rate_hz: float,
    folder: Path,
) -> None:
    """Drive the arm with the model's own rule between layers; leave its tables and figure."""
    from labcrane.machines import load_machine
    from labcrane_dmd.fit.driven import arm_settings
    from labcrane_dmd.fit.driven import drive as measure
    from labcrane_dmd.fit.figures import draw_validation
    from labcrane_dmd.fit.validation import summary, write_table

    operated = load_machine(machine)
    settings = arm_settings(operated, model, file)
    driven = measure(
        settings, model, operated, recordings, rate_hz, lambda text: out.print(text, markup=False)
    )
    levels = [each.level for each in driven]
    write_table((each.row() for each in driven), folder / "driven.csv")
    write_table(summary(levels), folder / "driven_summary.csv")
    rule = model.settings.between
    draw_validation(levels, f"{rule}, driven at {rate_hz:g} Hz", folder / "driven.png")
    _print(levels, f"{rule}, driven at {rate_hz:g} Hz")
    worst = max(each.formula_error for each in driven)
    out.print(f"driven speeds differ from the formula's by {worst:.2g} deg/s at most", markup=False)


def _print(levels: "Sequence[Level]", rule: str) -> None:
    from labcrane_dmd.fit.validation import summary

    numbers = ("mean_speed", "mse", "rmse", "mae", "max_abs_error", "residual_variance")
    table = _table("segment", "signal", *numbers, "mean_error", "%", title=f"{rule}, deg/s")
    for level in levels:
        row = level.row()
        table.add_row(
            level.segment,
            f"{level.signal:+d}",
            *(f"{row[name]:.4f}" for name in numbers),
            f"{row['mean_error']:+.4f}",
            f"{row['mean_error_percent']:+.2f}",
        )
    out.print(table)
    means = _table("segment", "mse", "rmse", "mae", "max_abs_error", "residual_variance", "largest")
    for mean in summary(levels):
        name, *values = mean.values()
        means.add_row(str(name), *(f"{value:.4f}" for value in values))
    out.print(means)


def plot(
    model: ModelPath,
    to: Annotated[
        Path | None, typer.Option("--out", help="PNG file; the model's name by default")
    ] = None,
    recordings: Annotated[
        Path | None,
        typer.Option(help="recordings of the fit, to plot their angles and speeds, too"),
    ] = None,
) -> None:
    """Plot a model's layers, and optionally the recorded angles and speeds."""
    from labcrane_dmd.fit.figures import draw_angles, draw_model, draw_speeds
    from labcrane_dmd.fit.recordings import read_recordings
    from labcrane_dmd.model.model_file import load

    path = to or model.with_suffix(".png")
    loaded = load(model)
    drawn = [path]
    draw_model(loaded, path)
    if recordings is not None:
        read = read_recordings(recordings)
        drawn += [path.with_stem(f"{path.stem}_{what}") for what in ("angle", "speed")]
        draw_angles(read, drawn[1])
        draw_speeds(loaded, read, drawn[2])
    for each in drawn:
        out.print(f"figure: {each}", markup=False)
