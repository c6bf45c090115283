"""Panels described by a DBC file."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from labcrane import ProtocolError
from labcrane_can.settings import ValveMap

if TYPE_CHECKING:
    from cantools.database import Message


MOST_BYTES = 1_000_000

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


def described(settings: ValveMap) -> "dict[int, tuple[Message, dict[str, str]]]":
    """Return, by frame id, the messages with valves in them, and which signal moves which joint."""
    messages = {message.name: message for message in _messages(settings.map)}
    found: dict[int, tuple[Message, dict[str, str]]] = {}
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
        found.setdefault(message.frame_id, (message, {}))[1][signal] = joint
    return found


def _messages(path: Path | None) -> "list[Message]":
    import cantools  # noqa: PLC0415 - loads for a moment

    try:
        found: Any = cantools.database.load_string(_text(path), "dbc")
    # What cantools' parsers raise on damaged files is not documented.
    except (OSError, cantools.Error, *GARBLED) as error:
        raise ProtocolError(f"map {str(path)!r} is no DBC file: {error}") from error
    return list(found.messages)


def _text(path: Path | None) -> str:
    size = Path(path or "").stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"it has {size} bytes; the most are {MOST_BYTES}")
    return Path(path or "").read_text(encoding="cp1252")  # as cantools reads DBC files
