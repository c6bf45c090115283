"""Stream header: what a stream holds, as XDF and LSL describe it."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Union
from xml.etree import ElementTree as ET

import numpy as np

from labcrane.errors import RecordingError
from labcrane.limits import LIMITS, LimitError, check_size

Description = Union[str, Mapping[str, "Description"]]  # noqa: UP007 - refers to itself

FORMATS: Mapping[str, np.dtype[np.generic] | None] = {
    "double64": np.dtype("<f8"),
    "float32": np.dtype("<f4"),
    "int64": np.dtype("<i8"),
    "int32": np.dtype("<i4"),
    "int16": np.dtype("<i2"),
    "int8": np.dtype("<i1"),
    "string": None,
}
"""The number formats of XDF by name; None for text."""


_TAG = re.compile(r"</|<(?=[^?!/])|/>")
"""Where an element ends, begins, or has ended at once."""


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel of a stream.

    Attributes
    ----------
    label, unit, type
        As the XDF metadata conventions have them.
    extra
        Further fields by name.
    """

    label: str
    unit: str = ""
    type: str = ""
    extra: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class StreamHeader:
    """The header of a stream.

    Attributes
    ----------
    name, type, source_id
        As LSL has them.
    channels
        In the order of the data.
    format
        A key of :data:`FORMATS`.
    rate_hz
        Samples per second, 0 for an irregular stream.
    desc
        Further description, as nested names and texts, next to the channels.
    text
        The XML of a foreign stream as it came, written and returned unchanged.
    """

    name: str
    type: str
    channels: tuple[Channel, ...]
    format: str = "double64"
    rate_hz: float = 0.0
    source_id: str = ""
    desc: Mapping[str, Description] = field(default_factory=dict)
    text: str | None = None

    def __post_init__(self) -> None:
        if self.format not in FORMATS:
            raise RecordingError(
                f"stream {self.name!r} has the channel format {self.format!r}; "
                f"XDF knows {', '.join(FORMATS)}"
            )
        if not self.channels:
            raise RecordingError(f"stream {self.name!r} has no channel; a stream needs one or more")

    @property
    def dtype(self) -> np.dtype[np.generic] | None:
        """The numpy type of one number; None for text."""
        return FORMATS[self.format]

    @property
    def labels(self) -> tuple[str, ...]:
        """One label per channel."""
        return tuple(channel.label for channel in self.channels)

    @property
    def host(self) -> str:
        """The computer that sent it, as LSL knows it; empty where that is missing."""
        found = re.search(r"<hostname>([^<]*)</hostname>", self.text or "")
        return found[1].strip() if found else ""

    @property
    def xml(self) -> str:
        """The header as it is written."""
        return self.text if self.text is not None else _compose(self)

    @classmethod
    def from_xml(cls, text: str) -> "StreamHeader":
        """Read a header that came from LSL or from an XDF file, and keep its text."""
        try:
            _check_text(text)
            info = ET.fromstring(text.strip().rstrip("\0"))  # noqa: S314 - checked, no entities
            count = int(info.findtext("channel_count") or 0)
            rate_hz = float(info.findtext("nominal_srate") or 0.0)
            check_size(count, "stream channels", f"stream {info.findtext('name')!r}")
            _check_rate(rate_hz)
        except (ET.ParseError, ValueError) as error:
            raise RecordingError(f"a stream header cannot be read: {error}") from error
        desc = info.find("desc")
        return cls(
            name=info.findtext("name") or "",
            type=info.findtext("type") or "",
            channels=_channels(desc, count),
            format=info.findtext("channel_format") or "",
            rate_hz=rate_hz,
            source_id=info.findtext("source_id") or "",
            desc={} if desc is None else _description(desc, leave="channels"),
            text=text,
        )


def _check_text(text: str) -> None:
    """Refuse headers that take long to read, by entities that expand to gigabytes or by depth."""
    check_size(len(text), "stream header", "it")
    if "<!" in text.replace("<!--", ""):
        raise LimitError("it holds a document type or entities, which LSL and XDF do not write")
    depth = 0
    for mark in _TAG.findall(text):
        depth += -1 if mark == "</" else 1 if mark == "<" else -1
        if depth > LIMITS["stream header"].depth:
            raise LimitError("its elements are nested too deep")


def _check_rate(rate_hz: float) -> None:
    if not (math.isfinite(rate_hz) and rate_hz >= 0.0):
        raise LimitError(f"its rate is {rate_hz} Hz")


def _compose(header: StreamHeader) -> str:
    info = ET.Element("info")
    for tag, value in {
        "name": header.name,
        "type": header.type,
        "channel_count": str(len(header.channels)),
        "channel_format": header.format,
        "nominal_srate": repr(float(header.rate_hz)),
        "source_id": header.source_id,
    }.items():
        ET.SubElement(info, tag).text = value
    desc = ET.SubElement(info, "desc")
    channels = ET.SubElement(desc, "channels")
    for channel in header.channels:
        fields = {"label": channel.label, "unit": channel.unit, "type": channel.type}
        _extend(ET.SubElement(channels, "channel"), fields | dict(channel.extra))
    _extend(desc, header.desc)
    return '<?xml version="1.0"?>' + ET.tostring(info, encoding="unicode")


def _extend(node: ET.Element, description: Mapping[str, Description]) -> None:
    for tag, value in description.items():
        child = ET.SubElement(node, tag)
        if isinstance(value, str):
            child.text = value
        else:
            _extend(child, value)


def _channels(desc: ET.Element | None, count: int) -> tuple[Channel, ...]:
    """Read the channels' metadata; foreign streams often have none, or some."""
    described = [] if desc is None else desc.findall("channels/channel")
    channels = []
    for number in range(count):
        node = described[number] if number < len(described) else ET.Element("channel")
        fields = {child.tag: (child.text or "").strip() for child in node if not len(child)}
        label = fields.pop("label", "") or f"channel {number + 1}"
        unit, kind = fields.pop("unit", ""), fields.pop("type", "")
        channels.append(Channel(label, unit, kind, fields))
    return tuple(channels)


def _description(node: ET.Element, leave: str = "") -> dict[str, Description]:
    """Read nested names and texts; of elements with the same name the last one stays."""
    return {
        child.tag: _description(child) if len(child) else (child.text or "")
        for child in node
        if child.tag != leave
    }
