"""Named quantities, and their places in an array."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from labcrane.errors import ProtocolError


@dataclass(frozen=True, slots=True)
class Signal:
    """A named quantity with one sample per tick, or per trial.

    Attributes
    ----------
    name
        Dotted path, and its path in a recording: ``"joint.angle"``.
    unit
        SI symbol; ``"1"`` when dimensionless.
    components
        Names of the parts of a vector, ``("slew", "shoulder")``; empty for a scalar.
    definition
        Its definition, in a sentence without a full stop; results of tasks have one.
    """

    name: str
    unit: str
    components: tuple[str, ...] = ()
    definition: str = field(default="", compare=False)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one sample; ``()`` is a scalar."""
        return (len(self.components),) if self.components else ()

    @property
    def columns(self) -> tuple[str, ...]:
        """One dotted name per number: ``"joint.angle.slew"``."""
        if not self.components:
            return (self.name,)
        return tuple(f"{self.name}.{part}" for part in self.components)


@dataclass(frozen=True)
class Layout:
    """The signals of one array of a frame, in order.

    Attributes
    ----------
    owner
        Owner of the signals, in words, for error messages: ``"the machine"``.
    signals
        In the order in which the array holds them.
    """

    owner: str
    signals: tuple[Signal, ...] = ()

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """One dotted name per number of the array."""
        return tuple(column for signal in self.signals for column in signal.columns)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """One unit per number of the array."""
        return tuple(signal.unit for signal in self.signals for _ in signal.columns)

    @cached_property
    def shape(self) -> tuple[int]:
        """Shape of the array."""
        return (self.size,)

    @property
    def size(self) -> int:
        """How many numbers the array holds."""
        return len(self.columns)

    def find(self, name: str) -> slice:
        """Return the place of the signal ``name``.

        Components name the quantities they need, and look them up once, in ``open``; a rig
        that lacks one is refused before the first tick.
        """
        start = 0
        for signal in self.signals:
            stop = start + len(signal.columns)
            if signal.name == name:
                return slice(start, stop)
            start = stop
        raise ProtocolError(f"{self.owner} has no {name!r}; it has {self._known()}")

    def index(self, column: str) -> int:
        """Return the place of the number ``column``: ``"joint.angle.slew"``, ``"left.x"``."""
        if column in self.columns:
            return self.columns.index(column)
        raise ProtocolError(
            f"{self.owner} has no {column!r}; it has {', '.join(self.columns) or 'nothing'}"
        )

    def _known(self) -> str:
        return ", ".join(signal.name for signal in self.signals) or "nothing"


def signals_of(names: Sequence[str], units: Mapping[str, str]) -> tuple[Signal, ...]:
    """Return signals with these columns, in the same order: the layout of a recording.

    Neighbours that differ only in their last word are the components of one vector.
    """
    signals: list[Signal] = []
    for column in names:
        name, _, component = column.rpartition(".")
        if name and signals and signals[-1].name == name:
            last = signals.pop()
            signals.append(Signal(name, last.unit, (*last.components, component)))
        elif name:
            signals.append(Signal(name, units[column], (component,)))
        else:
            signals.append(Signal(column, units[column]))
    return tuple(signals)


@dataclass(frozen=True, slots=True)
class SignalChannel:
    """One channel of a stream, as its header states it.

    Attributes
    ----------
    label, unit, type
        As in the XDF metadata conventions; unit and type may be empty.
    """

    label: str
    unit: str = ""
    type: str = ""


@dataclass(frozen=True, slots=True)
class SignalStream:
    """The description of an external stream that a signal monitor gets.

    Attributes
    ----------
    name, type
        As in LSL.
    rate_hz
        Nominal samples per second, 0 for an irregular stream.
    channels
        In the order of the samples' columns.
    """

    name: str
    type: str
    rate_hz: float
    channels: tuple[SignalChannel, ...]


@dataclass(frozen=True, slots=True)
class SignalFault:
    """A present fault of a signal.

    Attributes
    ----------
    channel
        Label of the channel; empty for the whole stream.
    kind
        The fault, in two or three words: ``"flat line"``.
    message
        The observation, with units, and its remedy.
    """

    channel: str
    kind: str
    message: str
