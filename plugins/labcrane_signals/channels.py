"""Channels by what they measure: units as factors, and which channels are not signals."""

from collections.abc import Sequence

from labcrane.core import SignalChannel, SignalStream

MICROVOLTS = {
    "": 1.0,  # the XDF convention for EEG, ECG and EMG
    "uv": 1.0,
    "µv": 1.0,
    "μv": 1.0,
    "microvolt": 1.0,
    "microvolts": 1.0,
    "nv": 1e-3,
    "nanovolt": 1e-3,
    "nanovolts": 1e-3,
    "mv": 1e3,
    "millivolt": 1e3,
    "millivolts": 1e3,
    "v": 1e6,
    "volt": 1e6,
    "volts": 1e6,
}
"""What one of a unit is in microvolts."""

NO_SIGNAL = (
    "counter",
    "trigger",
    "trig",
    "status",
    "battery",
    "marker",
    "event",
    "validity",
    "timestamp",
    "framenumber",
    "sequence",
    "button",
)
"""Words in the label or type of a channel that is not a signal: it may be constant or jump."""

OTHER_TYPES = ("light", "gsr", "eda", "resp", "temp", "accel", "ppg", "aux", "misc")
"""Words in the type of a channel that is not an electrode, whatever its unit."""

DIODE = ("photo", "diode")
"""Words in the label or type of a photodiode, which amplifiers call an electrode."""


def word(text: str) -> str:
    """Return a label's letters and digits alone, in lower case."""
    return "".join(letter for letter in text.lower() if letter.isalnum())


def is_signal(channel: SignalChannel) -> bool:
    """Whether a channel measures something, rather than counting or marking."""
    said = (word(channel.label), word(channel.type))
    return not any(each in text for each in NO_SIGNAL for text in said)


def signal_columns(stream: SignalStream) -> list[int]:
    """Return the columns that measure something."""
    return [at for at, channel in enumerate(stream.channels) if is_signal(channel)]


def electrodes(stream: SignalStream) -> tuple[list[int], list[float]]:
    """Return the columns of electrodes, and what one of their units is in microvolts."""
    columns, factors = [], []
    for column, channel in enumerate(stream.channels):
        factor = MICROVOLTS.get(channel.unit.strip().lower())
        if factor is not None and is_signal(channel) and not _is_other_sensor(channel):
            columns.append(column)
            factors.append(factor)
    return columns, factors


def _is_other_sensor(channel: SignalChannel) -> bool:
    label, kind = word(channel.label), word(channel.type)
    return any(each in kind for each in (*OTHER_TYPES, *DIODE)) or any(
        each in label for each in DIODE
    )


def labels(stream: SignalStream, columns: Sequence[int]) -> list[str]:
    """Return the labels of some columns."""
    return [stream.channels[column].label for column in columns]
