"""The session as LSL streams, for views, recorders and anyone else.

| stream            | type     | format   | a sample                                       |
|-------------------|----------|----------|------------------------------------------------|
| labcrane.state    | MoCap    | double64 | the machine's state, each tick                 |
| labcrane.input    | Joystick | double64 | axes and buttons, each tick                    |
| labcrane.markers  | Markers  | string   | an event as JSON (docs/markers.md)             |
| labcrane.labels   | Markers  | string   | the event's label (docs/markers.md)            |
| labcrane.codes    | Markers  | int32    | the event's code; the table is in the header   |
| labcrane.frame    | Frame    | double64 | a whole frame, each tick                       |
| labcrane.context  | Context  | string   | all there is to know, each change and second   |

Every sample carries the time at which it holds on the session's clock, which is liblsl's clock: a
frame the time its tick was due, an event the time it happened.
"""

import ctypes
import time
from typing import TYPE_CHECKING

import numpy as np

from labcrane.core.events import CODES, HED_VERSION, KINDS, OTHER
from labcrane.core.records import Frame, Run
from labcrane.core.signals import Layout
from labcrane.errors import StreamError
from labcrane.recording.journal import event_text
from labcrane.recording.labels import LABELS, Labels
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pylsl

STATE, INPUT = "labcrane.state", "labcrane.input"
MARKERS, CODE_STREAM = "labcrane.markers", "labcrane.codes"

CLOCK_TOLERANCE_S = 0.0001

# Types of the XDF MoCap conventions; what they do not know is named after the signal.
MOCAP = {"position": "Position", "orientation": "Orientation"}
BUTTONS = ("button", "trigger", "hat", "connected")


class Outlets:
    """The session's outlets. Open while the session runs.

    Parameters
    ----------
    run
        Its layouts become the streams' channels.
    source
        Which session this is, the same whenever it is resumed: ``"aiming/P001/ses-01"``. The
        streams' source ids are made of it, so that a recorder finds a restarted session again.
    """

    def __init__(self, run: Run, source: str) -> None:
        check_clock()
        state = stream_info(
            STATE, "MoCap", run.state.size, "double64", rate_hz=run.rate_hz, source=source
        )
        _describe_state(state, run.state)
        axes = stream_info(
            INPUT, "Joystick", run.axes.size, "double64", rate_hz=run.rate_hz, source=source
        )
        _describe_input(axes, run.axes)
        markers = stream_info(MARKERS, "Markers", 1, "string", rate_hz=0.0, source=source)
        channel(markers, label="event", unit="none", type="JSON")
        numbers = stream_info(CODE_STREAM, "Markers", 1, "int32", rate_hz=0.0, source=source)
        channel(numbers, label="code", unit="none", type="Code")
        _describe_codes(numbers)
        names = stream_info(LABELS, "Markers", 1, "string", rate_hz=0.0, source=source)
        channel(names, label="label", unit="none", type="Label")
        _describe_labels(names)
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

        self._labels = Labels()
        self._state = SampleOutlet(state, run.state.size)
        self._input = SampleOutlet(axes, run.axes.size)
        self._markers: pylsl.StreamOutlet | None = pylsl.StreamOutlet(markers)
        self._names: pylsl.StreamOutlet | None = pylsl.StreamOutlet(names)
        self._numbers: pylsl.StreamOutlet | None = pylsl.StreamOutlet(numbers)

    def push(self, frame: Frame) -> None:
        """Send a frame and its events. Does not wait for any receiver."""
        due = frame.tick.due
        self._state.push(frame.state, due)
        self._input.push(frame.axes, due)
        if not frame.events or not (self._markers and self._names and self._numbers):
            return
        for event in frame.events:
            _check_stamp(event.time)
            self._markers.push_sample([event_text(event, frame.tick.number)], event.time)
            self._names.push_sample([self._labels.label(event)], event.time)
            self._numbers.push_sample([CODES.get(event.name, OTHER)], event.time)

    def close(self) -> None:
        """End the streams: receivers see them disappear."""
        self._state.close()
        self._input.close()
        self._markers = self._names = self._numbers = None


class SampleOutlet:
    """An outlet of float64 samples.

    liblsl is handed a buffer of our own: half the time of ``push_sample`` with a list, and a third
    of ``push_chunk`` with an array.
    """

    def __init__(self, info: "pylsl.StreamInfo", size: int) -> None:
        import pylsl  # noqa: PLC0415
        from pylsl.lib import lib  # noqa: PLC0415

        self._buffer = np.zeros(size)
        self._pointer = ctypes.c_void_p(self._buffer.ctypes.data)
        self._outlet: pylsl.StreamOutlet | None = pylsl.StreamOutlet(info)
        self._send = lib.lsl_push_sample_dtp

    def push(self, values: FloatArray, stamp: float) -> None:
        _check_stamp(stamp)
        if self._outlet is None:
            raise StreamError("a frame cannot be sent after the outlets were closed")
        self._buffer[:] = values
        if status := self._send(self._outlet.obj, self._pointer, ctypes.c_double(stamp), 1):
            raise StreamError(f"liblsl refused a sample with error {status}")

    @property
    def description(self) -> str:
        """The stream as XML: a reader that has it needs no search."""
        return "" if self._outlet is None else str(self._outlet.get_info().as_xml())

    @property
    def taken(self) -> bool:
        """Whether the stream has a receiver."""
        return self._outlet is not None and bool(self._outlet.have_consumers())

    def close(self) -> None:
        self._outlet = None


def check_clock() -> None:
    """Make sure that liblsl's clock is the one the session runs on.

    Raises
    ------
    StreamError
        When ``pylsl.local_clock`` and ``time.perf_counter`` differ by more than 0.1 ms.
    """
    import pylsl  # noqa: PLC0415

    before = time.perf_counter()
    theirs = pylsl.local_clock()
    after = time.perf_counter()
    if not before - CLOCK_TOLERANCE_S <= theirs <= after + CLOCK_TOLERANCE_S:
        raise StreamError(
            f"liblsl's clock is {theirs - before:.6f} s from time.perf_counter, so samples cannot "
            "be stamped with the session's time; run on Linux with CPython's monotonic clock"
        )


def _check_stamp(stamp: float) -> None:
    """Refuse what liblsl would replace by the time of the push: 0 means now, -1 means deduce."""
    if not stamp > 0.0:
        raise StreamError(
            f"a sample cannot have the timestamp {stamp} s; LSL needs the computer's time, above 0"
        )


def stream_info(
    name: str, kind: str, channels: int, form: str, *, rate_hz: float, source: str
) -> "pylsl.StreamInfo":
    """Return the description of one of our streams, without its channels."""
    import pylsl  # noqa: PLC0415

    info = pylsl.StreamInfo(name, kind, channels, rate_hz, form, source_id(source, name))
    description = info.desc()
    acquisition = description.append_child("acquisition")
    acquisition.append_child_value("manufacturer", "labcrane")
    acquisition.append_child_value("model", name)
    acquisition.append_child_value("serial_number", source)
    timing = description.append_child("synchronization")
    for field in ("offset_mean", "offset_rms", "offset_median"):
        timing.append_child_value(field, "0")
    timing.append_child_value("can_drop_samples", "false")
    description.append_child("channels")
    return info


def channel(info: "pylsl.StreamInfo", **fields: str) -> None:
    """Describe one more channel of a stream."""
    entry = info.desc().child("channels").append_child("channel")
    for key, value in fields.items():
        entry.append_child_value(key, value)


def source_id(source: str, name: str) -> str:
    """Return the source id of one of a session's own streams."""
    return f"labcrane/{source}/{name}"


def _describe_state(info: "pylsl.StreamInfo", layout: Layout) -> None:
    for signal in layout.signals:
        owner, _, quantity = signal.name.rpartition(".")
        for column in signal.columns:
            fields = {"label": column, "unit": signal.unit, "object": owner or signal.name}
            if quantity in MOCAP and signal.components:
                part = column.rpartition(".")[2].upper()
                fields |= {"type": MOCAP[quantity] + part}
                if signal.unit == "m":
                    fields["unit"] = "meters"
            else:
                fields["type"] = "".join(word.title() for word in signal.name.split("."))
            channel(info, **fields)


def _describe_input(info: "pylsl.StreamInfo", layout: Layout) -> None:
    for column in layout.columns:
        words = column.replace(".", "_").lower().split("_")
        button = any(word.startswith(BUTTONS) for word in words)
        channel(info, label=column, unit="normalized", type="Button" if button else "Axis")


def _describe_codes(info: "pylsl.StreamInfo") -> None:
    table = info.desc().append_child("codes")
    for name, number in (("any other event", OTHER), *CODES.items()):
        entry = table.append_child("code")
        entry.append_child_value("event", name)
        entry.append_child_value("value", str(number))


def _describe_labels(info: "pylsl.StreamInfo") -> None:
    table = info.desc().append_child("labels")
    table.append_child_value("hed_version", HED_VERSION)
    for kind in KINDS.values():
        entry = table.append_child("label")
        entry.append_child_value("name", kind.label)
        entry.append_child_value("description", kind.meaning)
        entry.append_child_value("hed", kind.hed)
