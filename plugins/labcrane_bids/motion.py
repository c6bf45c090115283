"""Motion: one tracking system per device, its channels and its samples."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from labcrane.recording import SessionRecord, Stream

if TYPE_CHECKING:
    import pandas as pd

LATENCY = "latency"
AXES = ("x", "y", "z")
TYPES = {"tip.position": "POS", "tip.velocity": "VEL", "joint.angle": "JNTANG"}
"""BIDS has no type for a joint's speed, nor for a stick: those are MISC."""


@dataclass(frozen=True)
class TrackingSystem:
    """One device of a session.

    Attributes
    ----------
    label
        Value of the entity ``tracksys``.
    description
        What it is.
    channels
        One row per column of ``samples``: name, component, type, tracked_point, units.
    samples
        One row per tick; the first column is the time since the first tick, in seconds.
    """

    label: str
    description: str
    channels: "pd.DataFrame"
    samples: "pd.DataFrame"


def tracking_systems(session: SessionRecord, every: int) -> Iterator[TrackingSystem]:
    """Yield the crane, and each stick of the operator."""
    state, axes = session.streams["state"], session.streams["input"]
    yield _system("crane", "the simulated machine", state, list(map(str, state.data)), every)
    sticks: dict[str, list[str]] = {}
    for column in map(str, axes.data):
        sticks.setdefault(column.rpartition(".")[0] or "input", []).append(column)
    for stick, columns in sticks.items():
        name = {"left": "joyL", "right": "joyR"}.get(stick, "".join(filter(str.isalnum, stick)))
        yield _system(name, f"the operator's {stick} stick", axes, columns, every)


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
    samples = stream.data[columns].iloc[::every].copy()
    samples.insert(0, LATENCY, stream.time[::every] - stream.time[0])
    return TrackingSystem(label, description, channels, samples)


def _unit(unit: str) -> str:
    return "n/a" if unit in {"", "1"} else unit
