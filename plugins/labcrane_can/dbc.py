"""Panels described by a DBC file."""

from collections.abc import Iterator
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

GARBLED = (ValueError, LookupError, TypeError, ArithmeticError, AttributeError, RecursionError)


def signal_names(path: Path) -> dict[str, str]:
    """Return every signal of a DBC file by its name in lower case, as ``Message.Signal``.

    Raises
    ------
    ProtocolError
        The file cannot be read, or two signals have the same name.
    """
    found: dict[str, str] = {}
    for message in _messages(path):
        for signal in message.signals:
            full, name = f"{message.name}.{signal.name}", signal.name.lower()
            if name in found:
                raise ProtocolError(
                    f"{path} has two signals {name!r}, {found[name]} and {full}; say which moves "
                    f"the joint: --valve {name}={full}"
                )
            found[name] = full
    return found


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
    """Reject signals whose range in the DBC file is on one side of ``neutral`` only.

    Raises
    ------
    ProtocolError
        The range is on one side: a lever from 0 to 100 rests at 50, and with ``neutral: 0`` it
        would command half of full flow at rest.
    """
    for name, signal in _used(settings):
        least, most = signal.minimum, signal.maximum
        if least is None or most is None or least < settings.neutral < most:
            continue
        raise ProtocolError(
            f"{name} is {least:g} to {most:g} in {settings.map}, never on both sides of neutral, "
            f"which is {settings.neutral:g}; give the value of the lever at rest, as in neutral: "
            f"{(least + most) / 2:g}, and its value at full flow, full: {most:g}"
        )


def ranges(settings: ValveMap) -> dict[str, tuple[float, float]]:
    """Return least and greatest value of each signal that is used; without those not stated."""
    return {
        name: (float(signal.minimum), float(signal.maximum))
        for name, signal in _used(settings)
        if signal.minimum is not None and signal.maximum is not None
    }


def _used(settings: ValveMap) -> "Iterator[tuple[str, Signal]]":
    wanted = {str(name) for name in settings.valves.values()}
    for message in _messages(settings.map):
        for signal in message.signals:
            if (name := f"{message.name}.{signal.name}") in wanted:
                yield name, signal


def described(settings: ValveMap) -> "dict[FrameKey, tuple[Message, dict[str, str]]]":
    """Return, by key, the messages with valves in them, and which signal moves which joint.

    Raises
    ------
    ProtocolError
        The file cannot be read or has no such signal, signals of a message overlap, or a signal is
        on one side of ``neutral`` only.
    """
    import cantools  # noqa: PLC0415 - loads for a moment

    check_ranges(settings)
    messages = {message.name: message for message in _messages(settings.map)}
    found: dict[FrameKey, tuple[Message, dict[str, str]]] = {}
    for joint, name in settings.valves.items():
        message_name, _, signal = str(name).partition(".")
        message = messages.get(message_name)
        if message is None or signal not in {each.name for each in message.signals}:
            known = ", ".join(
                f"{each.name}.{one.name}" for each in messages.values() for one in each.signals
            )
            raise ProtocolError(
                f"{settings.map} has no {name!r} for joint {joint!r}; it has {known}"
            )
        try:
            message.refresh(strict=True)
        except cantools.Error as error:
            raise ProtocolError(
                f"{settings.map} cannot be used for joint {joint!r}: {error}"
            ) from error
        key = key_of(message.frame_id, extended=message.is_extended_frame)
        if message.is_extended_frame and message.frame_id & SOURCE == ANY_SOURCE:
            key = of_any_source(message.frame_id)
        found.setdefault(key, (message, {}))[1][signal] = joint
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
