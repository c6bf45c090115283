"""Panels described by a DBC file."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from labcrane import ProtocolError
from labcrane_can.settings import ValveMap

if TYPE_CHECKING:
    from cantools.database import Message
    from cantools.database.can import Signal


MOST_BYTES = 1_000_000

SOURCE, ANY_SOURCE, GROUP = 0xFF, 0xFE, 0x03FFFF00
"""Source address of an extended identifier, J1939's null address, and the parameter group."""

FrameKey = tuple[str, int]
"""Key that identifies a message."""


@dataclass(frozen=True, slots=True)
class DescribedMessage:
    """A message with levers in it: the names of their signals, by joint.

    A lever has the signals of its value and, where that has no sign, of both its sides.
    """

    message: "Message"
    levers: dict[str, tuple[str, ...]]


GARBLED = (ValueError, LookupError, TypeError, ArithmeticError, AttributeError, RecursionError)


def every_signal(path: Path) -> tuple[str, ...]:
    """Return every signal of a DBC file as ``Message.Signal``.

    Raises
    ------
    ProtocolError
        The file cannot be read.
    """
    return tuple(
        f"{message.name}.{signal.name}" for message in _messages(path) for signal in message.signals
    )


def check_ranges(settings: ValveMap) -> None:
    """Reject signals without a side whose range is on one side of ``neutral`` only.

    Raises
    ------
    ProtocolError
        The range is on one side: a lever that rests at 128 of 255 would command half of full flow
        at rest with ``neutral: 0``. What it is at rest, no range tells: another lever has the range
        0 to 100 because its value has no sign.
    """
    sided = {value for value, *sides in settings.levers().values() if sides}
    for name, signal in _used(settings):
        least, most = _range(signal)
        if name in sided or least < settings.neutral < most:
            continue
        raise ProtocolError(
            f"{name} is {least:g} to {most:g} in {settings.map}, never on both sides of neutral, "
            f"which is {settings.neutral:g}. Where it rests between its ends, give its values at "
            "rest and at full flow, neutral and full, as the panel's manual has them. Where it has "
            "no sign, name the signals of its sides: "
            f"{{value: {name}, positive: Message.Signal, negative: Message.Signal}}"
        )


def stated_ranges(settings: ValveMap) -> dict[str, tuple[float, float]]:
    """Return least and greatest value of each signal whose range the file states."""
    return {name: _range(signal) for name, signal in _used(settings) if _states_a_range(signal)}


def _states_a_range(signal: "Signal") -> bool:
    return signal.minimum is not None and signal.maximum is not None


def _range(signal: "Signal") -> tuple[float, float]:
    """Return the least and the greatest value: as stated, else what its bits can hold.

    Editors write ``[0|0]`` where no range was entered.
    """
    if signal.minimum is not None and signal.maximum is not None:
        return float(signal.minimum), float(signal.maximum)
    if signal.is_float:
        return -math.inf, math.inf
    half = 2 ** (signal.length - 1)
    raw = (-half, half - 1) if signal.is_signed else (0, 2 * half - 1)
    ends = [float(each * signal.scale + signal.offset) for each in raw]
    return min(ends), max(ends)


def _used(settings: ValveMap) -> "Iterator[tuple[str, Signal]]":
    wanted = {value for value, *_ in settings.levers().values()}
    for message in _messages(settings.map):
        for signal in message.signals:
            if (name := f"{message.name}.{signal.name}") in wanted:
                yield name, signal


def described(settings: ValveMap) -> dict[FrameKey, DescribedMessage]:
    """Return, by key, the messages with levers in them.

    Raises
    ------
    ProtocolError
        The file cannot be read or has no such signal, signals of a message overlap, those of a
        lever are in two messages, or a signal is on one side of ``neutral`` only.
    """
    import cantools  # noqa: PLC0415 - loads for a moment

    check_ranges(settings)
    messages = {message.name: message for message in _messages(settings.map)}
    known = [f"{each.name}.{one.name}" for each in messages.values() for one in each.signals]
    found: dict[FrameKey, DescribedMessage] = {}
    for joint, names in settings.levers().items():
        for name in names:
            if name not in known:
                raise ProtocolError(
                    f"{settings.map} has no {name!r} for joint {joint!r}; it has {', '.join(known)}"
                )
        (message_name, *others) = {name.partition(".")[0]: None for name in names}
        if others:
            raise ProtocolError(
                f"{settings.map} has the value of the lever for joint {joint!r} in {message_name} "
                f"and a side in {others[0]}; all of them must be in one message"
            )
        message = messages[message_name]
        try:
            message.refresh(strict=True)
        except cantools.Error as error:
            raise ProtocolError(
                f"{settings.map} cannot be used for joint {joint!r}: {error}"
            ) from error
        key = key_of(message.frame_id, extended=message.is_extended_frame)
        if message.is_extended_frame and message.frame_id & SOURCE == ANY_SOURCE:
            key = of_any_source(message.frame_id)
        signals = tuple(name.partition(".")[2] for name in names)
        found.setdefault(key, DescribedMessage(message, {})).levers[joint] = signals
    return found


def key_of(identifier: int, *, extended: bool) -> FrameKey:
    """Return the key of frames with this identifier; an extended one is another than a standard."""
    return ("extended" if extended else "standard", identifier)


def of_any_source(identifier: int) -> FrameKey:
    """Return the key of frames with this extended identifier, for any source and priority.

    J1939 identifies messages by their parameter group. Its DBC files have the null address as
    source, with which no device sends.
    """
    return "group", identifier & GROUP


def _messages(path: Path | None) -> "list[Message]":
    import cantools  # noqa: PLC0415 - loads for a moment

    try:
        found: Any = cantools.database.load_string(_text(path), "dbc", strict=False)
    # What cantools' parsers raise on damaged files is not documented.
    except (OSError, cantools.Error, *GARBLED) as error:
        raise ProtocolError(f"map {str(path)!r} is not a DBC file: {error}") from error
    return list(found.messages)


def _text(path: Path | None) -> str:
    size = Path(path or "").stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"it has {size} bytes; the most are {MOST_BYTES}")
    raw = Path(path or "").read_bytes()
    for encoding in ("utf-8-sig", "cp1252"):
        try:
            return raw.decode(encoding)
        except UnicodeDecodeError:
            continue
    return raw.decode("latin-1")  # every byte is a letter; names of signals are ASCII in all three
