"""Settings of a fit; written into the model, so that it can be fitted again."""

from typing import Literal

from pydantic import Field, PositiveInt, model_validator

from labcrane import Settings

Between = Literal["linear", "pchip"]

DeadBand = Literal["found", "none"]


class FitSettings(Settings):
    """Options for fitting a model."""

    levels: tuple[PositiveInt, ...] = (40, 80, 120, 160, 200, 250)
    """Signals whose recordings become layers, in both directions; 0 is zero."""

    validation: tuple[PositiveInt, ...] = (20, 60, 100, 140, 180, 220)
    """Signals whose recordings the fit does not use, in both directions."""

    edge: tuple[PositiveInt, ...] = (10, 30, 50)
    """Signals whose recordings, in addition to those of the layers, locate the edge of the dead
    band."""

    dead_band: DeadBand = "found"
    """``found``: the edge of the dead band is found from recordings at ``edge`` and ``levels``, and
    speed rises from there; ``none``: it rises from signal 0, a set of known speeds that are all 0,
    as in the paper, and ``edge`` is not used."""

    between: Between = "linear"
    """How speeds between two layers are found: by the straight line of the paper, or by a monotone
    cubic (Fritsch and Butland 1984)."""

    max_degree: int = Field(default=9, ge=1, le=12)
    """Largest degree of a layer's polynomial; cross-validation chooses one up to it."""

    @model_validator(mode="after")
    def _validated_by_others(self) -> "FitSettings":
        if not self.levels:
            raise ValueError("a model needs at least one level; write the signals of its layers")
        if both := sorted({*self.levels, *self.edge} & set(self.validation)):
            raise ValueError(
                f"signal {both[0]} is to validate the model and to be fitted; leave it out of one"
            )
        return self
