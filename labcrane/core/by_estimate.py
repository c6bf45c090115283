"""Law by which a number of an assistant or a feedback follows an estimate, within limits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Field, FiniteFloat, PositiveFloat, model_validator

from labcrane.core.references import EstimateValue
from labcrane.core.settings import Settings, Usual, WrongKey
from labcrane.core.signals import Layout, Signal

if TYPE_CHECKING:
    from labcrane.core.records import Frame
    from labcrane.types import FloatArray

OF_ESTIMATE = "estimate."
"""How the names of the columns of estimates begin: ``estimate.load.ratio``."""

Part = Annotated[float, Field(ge=0.0, le=1.0)]


class ByEstimate(Settings):
    """A number from 0 to 1 that follows the value of an estimate, within limits."""

    estimate: EstimateValue
    """The estimate and its value: ``load.ratio``."""

    between: tuple[FiniteFloat, FiniteFloat]
    """Two different values of the estimate."""

    to: tuple[Part, Part]
    """The numbers at these values; linear between them, and constant beyond."""

    at_most_per_s: Annotated[PositiveFloat, Usual(0.005, 20.0)]
    """Maximum change per second. It begins a session, or its continuation, with the first of the
    two numbers."""

    @model_validator(mode="after")
    def _maps(self) -> ByEstimate:
        if self.between[0] == self.between[1]:
            raise WrongKey(
                f"between has {self.between[0]:g} twice; give two different values",
                at=("between",),
            )
        return self

    def at(self, value: float) -> float:
        """Return the number, a fraction of 1, at a value of the estimate."""
        first, last = self.between
        part = min(max((value - first) / (last - first), 0.0), 1.0)
        return self.to[0] + part * (self.to[1] - self.to[0])


class Following:
    """A number over time: one that is constant, or one that follows an estimate.

    Attributes
    ----------
    value
        The number now.
    """

    def __init__(self, setting: float | ByEstimate) -> None:
        self._law = setting if isinstance(setting, ByEstimate) else None
        self.value = setting.to[0] if isinstance(setting, ByEstimate) else setting
        self._trial, self._elapsed = 0, 0.0

    def signals(self, name: str) -> tuple[Signal, ...]:
        """Return what is recorded of it: the number, unless it is constant."""
        return (Signal(name, "1"),) if self._law else ()

    @property
    def recorded(self) -> tuple[float, ...]:
        """The values of :meth:`signals`."""
        return (self.value,) if self._law else ()

    def open(self, axes: Layout) -> None:
        """Find the estimate among the axes of a run."""
        if self._law is not None:
            self._place = axes.index(OF_ESTIMATE + self._law.estimate)

    def after(self, seconds: float, axes: FloatArray) -> float:
        """Return the number, a fraction of 1, after seconds in which it could change.

        ``axes`` has the shape ``(n_axes,)``.
        """
        if self._law is not None:
            most = self._law.at_most_per_s * seconds
            change = self._law.at(float(axes[self._place])) - self.value
            self.value += min(max(change, -most), most)
        return self.value

    def shown(self, frame: Frame) -> float:
        """Return the number, a fraction of 1, for a frame that follows those presented.

        It changes within a trial, pauses left out; the same frame again changes nothing.
        """
        passed = frame.elapsed - self._elapsed if frame.trial == self._trial else 0.0
        self._trial, self._elapsed = frame.trial, frame.elapsed
        return self.after(max(passed, 0.0), frame.axes)
