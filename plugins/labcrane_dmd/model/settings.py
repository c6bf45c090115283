"""Settings of a fit; written into the model, so that it can be fitted again."""

from typing import Literal

from pydantic import Field

from labcrane import Settings

Between = Literal["linear", "pchip"]


class FitSettings(Settings):
    """What whoever fits a model may choose."""

    levels: tuple[int, ...] = (40, 80, 120, 160, 200, 250)
    """Signals whose recordings become layers, in both directions; 0 is zero."""

    validation: tuple[int, ...] = (20, 60, 100, 140, 180, 220)
    """Signals whose recordings are never looked at by the fit, in both directions."""

    edge: tuple[int, ...] = (10, 30, 50)
    """Signals from whose recordings, beside the layers', the edge of the dead band is found."""

    between: Between = "linear"
    """How speeds between two layers are found: by the straight line of the paper, or by a monotone
    cubic (Fritsch and Butland 1984)."""

    max_degree: int = Field(default=9, ge=1, le=12)
    """Largest degree of a layer's polynomial; cross-validation chooses one up to it."""
