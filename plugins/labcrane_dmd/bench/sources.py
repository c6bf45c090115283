"""Sources of a joint's signal and angle: a CAN bus, a log of one, LSL, or an earlier log."""

import csv
import math
import time as clock
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from labcrane import DeviceError, ProtocolError, RecordingError, StreamError
from labcrane.streams import NewestSample, numeric_labels
from labcrane_dmd.bench.steps import ANGLE, SAMPLE, SIGNAL, Sample
from labcrane_dmd.model.interpolation import FULL

if TYPE_CHECKING:
    import can
    import pylsl
    from cantools.database.can import Message

DEGREES = {"deg": 1.0, "degree": 1.0, "degrees": 1.0, "°": 1.0, "rad": math.degrees(1.0)}
"""Degrees in one of the unit in which an angle may come."""

VALVE_COMMAND = 0xFE30
"""First of the parameter groups of J1939's auxiliary valve commands (ISO 11783-7)."""

EXTEND, RETRACT = 1, 2
WAIT_S = 0.2
FIND_S = 10.0
BUFFER_S = 60

BACK_S = 0.01
"""Time in s by which a frame's timestamp may precede that of the frame before: drivers reorder
frames."""

CLOCK_S = 5.0
"""How often the offset of the other computer's clock is asked for."""


class CanValues:
    """Reads signal and angle out of frames.

    Parameters
    ----------
    signal
        The number of an auxiliary valve, or ``Message.Signal`` of the DBC file.
    angle
        ``Message.Signal`` of the DBC file; its unit there must be deg or rad.
    described
        The DBC file.
    neutral, full
        Values of a DBC signal at rest and at full flow.
    """

    def __init__(
        self, signal: str, angle: str, described: Path, full: float, neutral: float = 0.0
    ) -> None:
        import cantools  # noqa: PLC0415 - loads for a moment

        if full <= neutral:
            raise ProtocolError(
                f"--full is {full:g} and --neutral {neutral:g}; full flow is a greater value than "
                "the one at rest"
            )
        try:
            text = _text(described)
            database: Any = cantools.database.load_string(text, "dbc", strict=False)
        except (OSError, cantools.database.errors.Error) as error:
            raise RecordingError(f"{described} cannot be read as a DBC file: {error}") from error
        self._file, self._database = described, database
        self._valve = int(signal) if signal.isdecimal() else None
        self._neutral, self._full = neutral, full
        self._signal = None if self._valve is not None else self._find(signal)
        self._angle = self._find(angle)
        message, name = self._angle
        unit = str(message.get_signal_by_name(name).unit or "")
        if unit not in DEGREES:
            raise RecordingError(
                f"{angle} has unit {unit!r} in {described}; an angle is in {', '.join(DEGREES)}: "
                "write its unit into the DBC file"
            )
        self._degrees = DEGREES[unit]

    def read(self, frame: "can.Message") -> Iterator[Sample]:
        """Yield what a frame holds of the two; most hold nothing."""
        at, data = frame.timestamp, bytes(frame.data)
        if frame.is_error_frame or frame.is_remote_frame:
            return
        if self._valve is not None and frame.is_extended_id:
            group = (frame.arbitration_id >> 8) & 0x3FFFF
            if group == VALVE_COMMAND + self._valve and len(data) == 8 and data[0] <= FULL:  # noqa: PLR2004 - bytes
                sign = {EXTEND: 1, RETRACT: -1}.get(data[2] & 0x0F, 0)
                yield Sample(at, SIGNAL, float(sign * data[0]))
        if self._signal is not None and (value := _decoded(self._signal, frame)) is not None:
            flow = (value - self._neutral) / (self._full - self._neutral)
            yield Sample(at, SIGNAL, flow * FULL)
        if (value := _decoded(self._angle, frame)) is not None:
            yield Sample(at, ANGLE, value * self._degrees)

    def _find(self, written: str) -> "tuple[Message, str]":
        message, _, name = written.partition(".")
        there = {each.name: each for each in self._database.messages}
        names = [each.name for each in there[message].signals] if message in there else []
        if name not in names:
            said = [f"{each.name}.{one.name}" for each in there.values() for one in each.signals]
            raise RecordingError(
                f"{written!r} is not in {self._file}, which has {', '.join(said[:12])}"
                f"{' and more' if len(said) > 12 else ''}"  # noqa: PLR2004 - a line of them
            )
        return there[message], name


def _text(path: Path) -> str:
    """Return a DBC file's text; names of signals are the same letters in every encoding."""
    raw = path.read_bytes()
    for encoding in ("utf-8-sig", "cp1252"):
        try:
            return raw.decode(encoding)
        except UnicodeDecodeError:
            continue
    return raw.decode("latin-1")


def _decoded(which: "tuple[Message, str]", frame: "can.Message") -> float | None:
    from cantools.database.errors import Error  # noqa: PLC0415 - loads for a moment

    message, name = which
    same = (message.frame_id, message.is_extended_frame)
    if (frame.arbitration_id, frame.is_extended_id) != same:
        return None
    try:
        found: Any = message.decode(bytes(frame.data), decode_choices=False)
        value = float(found[name])
    except (Error, KeyError, TypeError, ValueError):  # too short, or another multiplexed part
        return None
    return value if math.isfinite(value) else None


def read_log(path: Path, values: CanValues) -> Iterator[Sample]:
    """Yield what a candump, asc or blf log holds.

    Raises
    ------
    RecordingError
        It cannot be read as one, or its clock goes back.
    """
    import can  # noqa: PLC0415 - loads for a moment

    last = -math.inf
    try:
        with can.LogReader(path) as log:
            for number, frame in enumerate(log, 1):
                # An asc log may count each time from the frame before it.
                if getattr(log, "timestamps_format", "") == "relative" and number > 1:
                    frame.timestamp += last
                if frame.timestamp < last - BACK_S:
                    raise RecordingError(
                        f"the clock of {path} goes back by {last - frame.timestamp:g} s at its "
                        f"frame {number}, so the speed there is unknown; cut the log there"
                    )
                last = frame.timestamp
                yield from values.read(frame)
    except (OSError, ValueError, can.CanError) as error:
        raise RecordingError(
            f"{path} cannot be read as a candump, asc or blf log: {error}"
        ) from error


def read_bus(name: str, bitrate: int, values: CanValues, seconds: float | None) -> Iterator[Sample]:
    """Yield what comes on a bus, until ``seconds`` have passed or for ever.

    Raises
    ------
    DeviceError
        The bus cannot be opened, or is lost.
    """
    import can  # noqa: PLC0415 - loads for a moment

    interface, _, channel = name.partition(":")
    try:
        bus = can.Bus(interface=interface, channel=channel, bitrate=bitrate)
    except (OSError, ValueError, ImportError, can.CanError) as error:
        raise DeviceError(f"the bus {name!r} cannot be opened: {error}") from error
    with bus:
        end = math.inf if seconds is None else clock.monotonic() + seconds
        while clock.monotonic() < end:
            try:
                frame = bus.recv(WAIT_S)
            except (OSError, can.CanError) as error:
                raise DeviceError(f"the bus {name!r} is lost: {error}") from error
            if frame is not None:
                yield from values.read(frame)


def read_lsl(
    signal: str, angle: str, segment: str, seconds: float | None, find_s: float = FIND_S
) -> Iterator[Sample]:
    """Yield the samples of two LSL streams on this computer's clock.

    Parameters
    ----------
    signal, angle
        A stream's name, or ``STREAM:CHANNEL``; without a channel it is labelled as the segment.
        The angle's channel has a unit, deg or rad; the signal is -250 to 250.
    segment
        The joint.
    seconds
        How long; for ever when None.
    find_s
        How long a stream is looked for, in seconds.

    Raises
    ------
    DeviceError
        A stream is not there, is lost, or has no such channel.
    """
    channels = [_Channel(signal, segment, find_s), _Channel(angle, segment, find_s, DEGREES)]
    try:
        for channel in channels:
            channel.wait()
        end = math.inf if seconds is None else clock.monotonic() + seconds
        while clock.monotonic() < end:
            for channel, what in zip(channels, (SIGNAL, ANGLE), strict=True):
                for time, value in channel.pull():
                    yield Sample(time, what, value)
            clock.sleep(0.01)
    finally:
        for channel in channels:
            channel.close()


class _Channel:
    """One channel of a stream, with stamps on this computer's clock and values in one unit."""

    def __init__(
        self, written: str, segment: str, find_s: float, units: Mapping[str, float] | None = None
    ) -> None:
        self._stream, _, label = written.partition(":")
        self._label, self._units, self._find_s = label or segment, units, find_s
        self._index, self._factor = 0, 1.0
        self._offset, self._asked = 0.0, -math.inf
        self._samples = NewestSample({"name": self._stream}, self._accept, BUFFER_S)

    def wait(self) -> None:
        """Wait until it is received.

        Raises
        ------
        DeviceError
            It is not there, or of no use.
        """
        if not self._samples.wait(self._find_s):
            why = self._samples.complaint or "start its program"
            raise DeviceError(f"no LSL stream {self._stream!r} can be used: {why}")

    def pull(self) -> list[tuple[float, float]]:
        """Return the samples that came: times in s, and values.

        Raises
        ------
        DeviceError
            The stream is gone, so that its clock cannot be asked.
        """
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

        if clock.monotonic() - self._asked > CLOCK_S:
            try:
                self._offset = self._samples.time_correction(self._find_s)
            except (pylsl.util.LostError, pylsl.util.TimeoutError) as error:
                raise DeviceError(f"the LSL stream {self._stream!r} is lost: {error}") from error
            self._asked = clock.monotonic()
        samples, stamps = self._samples.pull()
        return [
            (stamp + self._offset, float(sample[self._index]) * self._factor)
            for stamp, sample in zip(stamps, samples, strict=True)
        ]

    def close(self) -> None:
        """Let go of the stream."""
        self._samples.close()

    def _accept(self, info: "pylsl.StreamInfo") -> None:
        """Take which channel it is, and its unit."""
        labels = numeric_labels(info)
        if self._label not in labels:
            raise StreamError(
                f"it has no channel {self._label!r}, it has "
                f"{', '.join(labels) or 'none with a label'}; write STREAM:CHANNEL"
            )
        self._index = labels.index(self._label)
        if self._units is None:
            return
        units = [str(each) for each in info.get_channel_units() or []]
        unit = units[self._index] if units else ""
        if unit not in self._units:
            raise StreamError(
                f"its angle has unit {unit!r}; its description must say {', '.join(self._units)}"
            )
        self._factor = self._units[unit]


def read_raw(path: Path) -> Iterator[Sample]:
    """Yield what :func:`kept` wrote.

    Raises
    ------
    RecordingError
        The file does not have this format.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                yield Sample(float(row["time_s"]), row["what"], float(row["value"]))
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise RecordingError(
            f"{path} cannot be read as a raw log, which has the columns {', '.join(SAMPLE)}: "
            f"{error!r}"
        ) from error


def kept(samples: Iterator[Sample], path: Path) -> Iterator[Sample]:
    """Yield the samples on, each written down before: whatever ends the program, they are there.

    Raises
    ------
    RecordingError
        There is such a file already.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        file = path.open("x", newline="", encoding="utf-8")
    except FileExistsError:
        raise RecordingError(
            f"{path} already exists, and recordings are not overwritten; give another folder, "
            f"or cut the existing log again: --log {path}"
        ) from None
    with file:
        writer = csv.writer(file)
        writer.writerow(SAMPLE)
        for sample in samples:
            writer.writerow((repr(sample.time), sample.what, repr(sample.value)))
            file.flush()
            yield sample
