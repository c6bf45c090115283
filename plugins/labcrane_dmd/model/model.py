"""A Dynamic Model Description: how fast each segment moves at which signal and angle."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from statistics import mean

from labcrane import ProtocolError
from labcrane.machines import Joint
from labcrane_dmd.model.interpolation import FULL, Layer, is_signal, linear, pchip
from labcrane_dmd.model.settings import Between, FitSettings

Valve = tuple[float, float, float]
"""Dead band in signals, dead time and lag in s."""


@dataclass(frozen=True, slots=True)
class Direction:
    """One direction of a segment.

    Attributes
    ----------
    dead_band
        Size of the signal up to which the joint stands still.
    dead_time, lag
        From the signal's step until the valve begins to open, and the time constant with which it
        opens, in seconds.
    layers
        With the size of their signals rising.
    """

    dead_band: float
    dead_time: float
    lag: float
    layers: tuple[Layer, ...]

    def speed(self, size: float, angle: float, between: Between) -> float:
        """Return the speed in rad/s at a signal of this direction, given by its size."""
        if size <= self.dead_band:
            return 0.0
        signals, speeds = [self.dead_band], [0.0]
        for place, layer in enumerate(self.layers):
            if abs(layer.signal) > self.dead_band:
                signals.append(abs(layer.signal))
                speeds.append(self._layer_speed(place, angle))
        return (pchip if between == "pchip" else linear)(size, signals, speeds)

    def _layer_speed(self, place: int, angle: float) -> float:
        """Return a layer's speed; where a slow one was not measured, it goes like the next one.

        Held at its last angle, a slow layer would be wrong by as much as the lever geometry changes
        over the rest of the range. The next layer was measured there.
        """
        layer = self.layers[place]
        lowest, highest = layer.covers
        end = lowest if angle < lowest else highest if angle > highest else None
        if end is None or layer.whole or place + 1 == len(self.layers):
            return layer.speed(angle)
        there = self._layer_speed(place + 1, end)
        return layer.speed(end) * (self._layer_speed(place + 1, angle) / there) if there else 0.0


@dataclass(frozen=True, slots=True)
class SegmentModel:
    """One segment of the machine.

    Attributes
    ----------
    name
        The joint it moves.
    limits
        Lowest and highest recorded angle, in rad.
    extend, retract
        The two directions: positive and negative signals.
    between
        How speeds between two layers are found.
    """

    name: str
    limits: tuple[float, float]
    extend: Direction
    retract: Direction
    between: Between

    def direction(self, signal: float) -> Direction:
        """Return the direction that a signal moves the joint in."""
        return self.retract if signal < 0.0 else self.extend

    def speed(self, signal: float, angle: float) -> float:
        """Return the joint's speed at a valve signal.

        Layers are polynomials in angle; between two layers the speed is linear in the signal
        (Typiak 2024, section 2.1) or a monotone cubic. Outside the measured angles the end value
        holds.

        Parameters
        ----------
        signal
            Valve signal, -250 to 250, in steps of 0.4 % of full flow.
        angle
            Joint angle in rad.

        Returns
        -------
        float
            Speed in rad/s, positive for extending.

        Raises
        ------
        ProtocolError
            The signal is beyond full flow.
        """
        if not is_signal(signal, FULL):
            raise ProtocolError(f"{self.name!r}: signal {signal:g} is not within -250 to 250")
        return self.direction(signal).speed(abs(signal), angle, self.between)

    def layers(self) -> Iterator[Layer]:
        """Yield all layers, from the lowest signal to the highest."""
        yield from reversed(self.retract.layers)
        yield from self.extend.layers


@dataclass(frozen=True, slots=True)
class Source:
    """Where a segment's figures come from: its recording, by name and hash."""

    file: str
    sha256: str


@dataclass(frozen=True)
class Model(Mapping[str, SegmentModel]):
    """The segments by name, and how they came to be.

    Attributes
    ----------
    segments
        By name.
    sources
        By segment.
    settings
        With which it was fitted.
    labcrane
        Version that fitted it.
    """

    segments: Mapping[str, SegmentModel]
    sources: Mapping[str, Source]
    settings: FitSettings
    labcrane: str

    def __getitem__(self, name: str) -> SegmentModel:
        return self.segments[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.segments)

    def __len__(self) -> int:
        return len(self.segments)

    def proportional(self, joint: Joint, valve: Valve | None = None) -> SegmentModel:
        """Return a segment whose speed beyond the dead band is proportional to the signal.

        Parameters
        ----------
        joint
            It moves at its full speed at full flow, in both directions, at any angle.
        valve
            Dead band in signals, dead time and lag in s; by default the means of the model's own.
        """
        band, time, lag = valve or self._mean_valve()

        def direction(sign: float) -> Direction:
            full = Layer(sign * FULL, joint.limits, True, (sign * joint.speed,))  # noqa: FBT003
            return Direction(band, time, lag, (full,))

        return SegmentModel(joint.name, joint.limits, direction(1.0), direction(-1.0), "linear")

    def _mean_valve(self) -> Valve:
        each = [way for segment in self.values() for way in (segment.extend, segment.retract)]
        bands, times, lags = zip(*((w.dead_band, w.dead_time, w.lag) for w in each), strict=True)
        return mean(bands), mean(times), mean(lags)

    def interpolated(self, between: Between) -> "Model":
        """Return the same layers with another rule between them."""
        segments = {name: replace(each, between=between) for name, each in self.items()}
        settings = self.settings.model_copy(update={"between": between})
        return replace(self, segments=segments, settings=settings)
