"""A model as a YAML file: readable, and with everything needed to make it again."""

import io
import math
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, NonNegativeFloat, model_validator
from ruamel.yaml import YAML

from labcrane import ProtocolError, Settings
from labcrane.core import read_settings
from labcrane_dmd.model.interpolation import FULL, Layer
from labcrane_dmd.model.model import Direction, Model, SegmentModel, Source
from labcrane_dmd.model.output import written
from labcrane_dmd.model.settings import Between, FitSettings

HEADER = """\
# Dynamic Model Description: how fast each segment moves at which valve signal and angle.
# Signals go from -250 to 250 in steps of 0.4 % of full flow; positive signals extend.
# speed in deg/s = c0 + c1 x + c2 x^2 + ...; x goes from -1 to 1 over the layer's covers_deg.
# Layers with whole: false did not get over the whole range while they were recorded; beyond
# covers_deg they go like the next stronger layer. Others keep the speed of their last angle.
# Where the joint set off, the angles in which the valve was still opening have the next weaker
# layer's shape.
"""


class LayerText(Settings):
    """One layer as the file has it."""

    signal: float = Field(ge=-FULL, le=FULL)
    """Valve signal."""

    covers_deg: tuple[float, float]
    """Lowest and highest angle, in degrees: the measured ones, and where the joint set off, those
    of the next weaker layer."""

    whole: bool
    """Whether these are, but for the run-up, all angles of the joint."""

    speed_deg_s: tuple[float, ...]
    """Coefficients of 1, x, x², ...; none if the joint does not move at this signal."""

    @model_validator(mode="after")
    def _covers_something(self) -> "LayerText":
        if not self.covers_deg[0] < self.covers_deg[1]:
            raise ValueError(
                f"covers_deg must rise, but is {self.covers_deg}; write the lowest angle first"
            )
        return self


class DirectionText(Settings):
    """One direction as the file has it."""

    dead_band: NonNegativeFloat
    """Size of the signal up to which the joint does not move."""

    dead_time_s: NonNegativeFloat
    """From the step of the signal until the valve begins to open, in seconds."""

    lag_s: NonNegativeFloat
    """Time constant with which the valve opens, in seconds."""

    layers: tuple[LayerText, ...] = Field(min_length=1)
    """With the size of their signals rising."""

    @model_validator(mode="after")
    def _layers_rise(self) -> "DirectionText":
        sizes = [abs(layer.signal) for layer in self.layers]
        if any(after <= before for before, after in pairwise(sizes)):
            raise ValueError(
                f"layers must get stronger, but their signals are {sizes}; write the weakest first"
            )
        return self


class SegmentText(Settings):
    """One segment as the file has it."""

    recording: str
    """File that it was fitted to."""

    sha256: str
    """That file's hash."""

    range_deg: tuple[float, float]
    """Lowest and highest recorded angle, in degrees."""

    extend: DirectionText
    """Positive signals."""

    retract: DirectionText
    """Negative signals."""


class ModelText(Settings):
    """The whole file."""

    labcrane_dmd: Literal[1]
    """Version of this format."""

    fitted_by: str
    """Version of labcrane that made it."""

    fit: FitSettings
    """With which settings."""

    segments: dict[str, SegmentText] = Field(min_length=1)
    """By the name of the joint they move."""


def load(path: Path | str, between: Between | None = None) -> Model:
    """Read a model: ``load(path)["boom"].speed(signal, angle)``.

    Parameters
    ----------
    path
        The YAML file.
    between
        Another rule between layers than the file's own: ``"linear"`` or ``"pchip"``.

    Raises
    ------
    ProtocolError
        The file is missing, or no model; the message says where it goes wrong.
    """
    try:
        text = read_settings(Path(path), ModelText)
    except ProtocolError as error:
        first, *more = str(error).splitlines()
        rest = f", and {len(more)} more" if more else ""
        raise ProtocolError(
            f"{str(path)!r} is not a model: {first}{rest}; make one with labcrane dmd fit",
            at=("model",),
        ) from error
    rule = between or text.fit.between
    return Model(
        segments={name: _segment(name, each, rule) for name, each in text.segments.items()},
        sources={name: Source(each.recording, each.sha256) for name, each in text.segments.items()},
        settings=text.fit.model_copy(update={"between": rule}),
        labcrane=text.fitted_by,
    )


def save(model: Model, path: Path) -> None:
    """Write a model; the same model gives the same bytes.

    Raises
    ------
    RecordingError
        The file cannot be written.
    """
    text = {
        "labcrane_dmd": 1,
        "fitted_by": model.labcrane,
        "fit": model.settings.model_dump(mode="json"),
        "segments": {
            name: {
                "recording": model.sources[name].file,
                "sha256": model.sources[name].sha256,
                "range_deg": _degrees(segment.limits),
                "extend": _direction_text(segment.extend),
                "retract": _direction_text(segment.retract),
            }
            for name, segment in model.items()
        },
    }
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 100
    out = io.StringIO()
    yaml.dump(text, out)
    with written(path):
        path.write_text(HEADER + out.getvalue(), encoding="utf-8")


def _segment(name: str, text: SegmentText, between: Between) -> SegmentModel:
    lowest, highest = map(math.radians, text.range_deg)
    extend, retract = _direction(text.extend), _direction(text.retract)
    return SegmentModel(name, (lowest, highest), extend, retract, between)


def _direction(text: DirectionText) -> Direction:
    layers = tuple(
        Layer(
            signal=layer.signal,
            covers=(math.radians(layer.covers_deg[0]), math.radians(layer.covers_deg[1])),
            whole=layer.whole,
            coefficients=tuple(map(math.radians, layer.speed_deg_s)),
        )
        for layer in text.layers
    )
    return Direction(text.dead_band, text.dead_time_s, text.lag_s, layers)


def _direction_text(direction: Direction) -> dict[str, Any]:
    return {
        "dead_band": direction.dead_band,
        "dead_time_s": direction.dead_time,
        "lag_s": direction.lag,
        "layers": [
            {
                "signal": int(layer.signal),
                "covers_deg": _degrees(layer.covers),
                "whole": layer.whole,
                "speed_deg_s": _degrees(layer.coefficients),
            }
            for layer in direction.layers
        ],
    }


def _degrees(values: tuple[float, ...]) -> list[float]:
    return [float(f"{math.degrees(value):.9g}") for value in values]
