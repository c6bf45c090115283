"""Auxiliary valve messages of ISO 11783-7: encoding and decoding.

A command (PGN 0xFE30 plus the valve's number) has the port flow in its first byte, 0 to 250 in
steps of 0.4 %. The third byte contains the valve's state, and thus the sign of the signal.
"""

from dataclasses import dataclass
from enum import IntEnum

COMMAND, ESTIMATED, MEASURED = 0xFE30, 0xFE10, 0xFE20
"""First of the 16 parameter groups of each kind; the valve's number is added."""

PRIORITY = 3
FULL = 250
LENGTH = 8
NOT_AVAILABLE, ERROR = 0xFF, 0xFE
OWN_NODE = 0x80
"""Source address of the messages that labcrane sends; a valve's is 0x80 plus its number."""

FLOW_OFFSET = 125
"""Offset that is added to a flow in percent when it is sent back."""


class State(IntEnum):
    """The commanded state of a valve; all other values are reserved."""

    BLOCK = 0
    EXTEND = 1
    RETRACT = 2
    FLOAT = 3
    INIT = 10
    ERROR = 14
    NOT_AVAILABLE = 15


class FrameError(ValueError):
    """A frame that says it is a valve's command and is none, in words."""


@dataclass(frozen=True, slots=True)
class ValveCommand:
    """One command.

    Attributes
    ----------
    valve, node, priority
        Number of the valve, source address and priority.
    signal
        -250 to 250, positive for extend; 0 in block and float.
    state, fail_safe
        What the valve is to do now, and what when commands stop: 0 is block, 1 float.
    """

    valve: int
    node: int
    priority: int
    signal: int
    state: State
    fail_safe: int


def group(identifier: int) -> int:
    """Return the parameter group of an extended identifier whose messages are for everyone."""
    return (identifier >> 8) & 0x3FFFF


def decode(identifier: int, data: bytes) -> ValveCommand | None:
    """Return the command in an extended frame, or None when it is something else.

    Raises
    ------
    FrameError
        It has a valve command's identifier, and cannot be obeyed.
    """
    valve = group(identifier) - COMMAND
    if not 0 <= valve <= 15:  # noqa: PLR2004 - four bits
        return None
    if len(data) != LENGTH:
        raise FrameError(f"valve {valve}: {len(data)} bytes instead of 8")
    flow, what = data[0], data[2] & 0x0F
    if flow > FULL:
        why = {NOT_AVAILABLE: "not available", ERROR: "in error"}.get(flow, f"reserved, {flow}")
        raise FrameError(f"valve {valve}: the port flow is {why}")
    try:
        state = State(what)
    except ValueError:
        raise FrameError(f"valve {valve}: the state {what} is reserved") from None
    if state in (State.INIT, State.ERROR, State.NOT_AVAILABLE):
        raise FrameError(f"valve {valve}: the state is {state.name.lower().replace('_', ' ')}")
    signal = {State.EXTEND: flow, State.RETRACT: -flow}.get(state, 0)
    node, priority = identifier & 0xFF, (identifier >> 26) & 7
    return ValveCommand(valve, node, priority, signal, state, data[2] >> 6)


def encode(
    valve: int, signal: int, node: int, state: State | None = None, priority: int = PRIORITY
) -> tuple[int, bytes]:
    """Return identifier and data of a command; its sign says extend or retract, 0 block."""
    if not -FULL <= signal <= FULL:
        raise ValueError(f"valve {valve}: signal {signal} is not within -250 to 250")
    if state is None:
        state = State.EXTEND if signal > 0 else State.RETRACT if signal < 0 else State.BLOCK
    data = bytes([abs(signal), 0xFF, 0x30 | state, *(NOT_AVAILABLE,) * 5])
    return _identifier(COMMAND + valve, node, priority), data


def encode_flow(kind: int, valve: int, percent: float, node: int = OWN_NODE) -> tuple[int, bytes]:
    """Return identifier and data of an estimated or measured flow in percent, with its sign."""
    whole = max(-FLOW_OFFSET, min(FLOW_OFFSET, round(percent)))
    extend, retract = max(whole, 0), max(-whole, 0)
    state = State.EXTEND if whole > 0 else State.RETRACT if whole < 0 else State.BLOCK
    data = bytes([extend + FLOW_OFFSET, retract + FLOW_OFFSET, 0x30 | state, *(NOT_AVAILABLE,) * 5])
    return _identifier(kind + valve, node, PRIORITY), data


def _identifier(pgn: int, node: int, priority: int) -> int:
    return (priority << 26) | (pgn << 8) | node
