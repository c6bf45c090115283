"""Motion: one tracking system per device, its channels and its samples."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from labcrane import FloatArray
from labcrane.recording import SessionRecord, Stream
from labcrane_bids.files import ROWS

if TYPE_CHECKING:
    import pandas as pd

LATENCY = "latency"
AXES = ("x", "y", "z")
TYPES = {"tip.position": "POS", "tip.velocity": "VEL", "joint.angle": "JNTANG"}
"""BIDS has no type for a joint's speed, nor for a stick: those are MISC."""

NOT_STICKS = {"assist.": "the assistant's stick ", "estimate.": "values of the estimate "}
"""What is recorded with the operator's sticks and is none of them, by the beginning of its name."""


@dataclass(frozen=True)
class TrackingSystem:
    """One device of a session.

    Attributes
    ----------
    label
        Value of the entity ``tracksys``.
    description
        Description of the device.
    channels
        One row per column of its samples: name, component, type, tracked_point, units.
    count
        Samples, of which every so many is one of the session's ticks.
    seconds
        From the first sample to the last.
    """

    label: str
    description: str
    channels: "pd.DataFrame"
    count: int
    seconds: float
    _stream: Stream
    _columns: list[str]
    _every: int

    def samples(self) -> Iterator[list[FloatArray]]:
        """Yield the samples' columns in chunks; the first column is seconds from sample 0."""
        stream, (zero,) = self._stream, self._stream.column("time", 0, 1)
        ticks = ROWS - ROWS % self._every or self._every  # so that each chunk begins with a sample
        for at in range(0, len(stream), ticks):
            values = stream.values(self._columns, at, at + ticks)
            time = stream.column("time", at, at + ticks) - zero
            yield [each[:: self._every] for each in (time, *values.values())]


def tracking_systems(session: SessionRecord, every: int) -> Iterator[TrackingSystem]:
    """Yield the crane, what an assistant shares, each stick, and each estimate."""
    state, axes, command = (session.streams[name] for name in ("state", "input", "command"))
    yield _system("crane", "the simulated machine", state, list(state.units), every)
    if shared := [column for column in command.units if column.startswith("assist.")]:
        about = "the assistant's share, and the joint speeds that operator and assistant ask for"
        yield _system("assist", about, command, shared, every)
    sticks: dict[str, list[str]] = {}
    for column in axes.units:
        sticks.setdefault(column.rpartition(".")[0] or "input", []).append(column)
    for stick, columns in sticks.items():
        name = {"left": "joyL", "right": "joyR"}.get(stick, "".join(filter(str.isalnum, stick)))
        about = next(
            (
                text + stick.removeprefix(of)
                for of, text in NOT_STICKS.items()
                if stick.startswith(of)
            ),
            f"the operator's {stick} stick",
        )
        yield _system(name, about, axes, columns, every)


def _system(
    label: str, description: str, stream: Stream, columns: list[str], every: int
) -> TrackingSystem:
    import pandas as pd

    rows = [(LATENCY, "n/a", "LATENCY", "n/a", "s")]
    for column in columns:
        signal, _, part = column.rpartition(".")
        kind = TYPES.get(signal, "MISC")
        point = "tip" if signal.startswith("tip") else part if signal.startswith("joint") else label
        component = part if part in AXES else "n/a"
        rows.append((column, component, kind, point, _unit(stream.units[column])))
    channels = pd.DataFrame(rows, columns=["name", "component", "type", "tracked_point", "units"])
    count = -(-len(stream) // every)
    last = (count - 1) * every
    ends = [stream.column("time", at, at + 1) for at in (0, last)] if count else []
    seconds = float(ends[1][0] - ends[0][0]) if ends else 0.0
    return TrackingSystem(label, description, channels, count, seconds, stream, columns, every)


def _unit(unit: str) -> str:
    return "n/a" if unit in {"", "1"} else unit
