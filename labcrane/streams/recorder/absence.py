"""Absence of a stream that is waited for: why it may not be found, in words that say what to do."""

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from labcrane.errors import StreamError, shortened
from labcrane.streams.network import Network, describe, free_ports, port_range
from labcrane.streams.request import OURS, StreamRequest

if TYPE_CHECKING:
    import pylsl

PATIENCE_S = 15.0
"""After so long without a stream, its program is not merely slow to start."""

MOST_NAMED = 6


def absent(request: StreamRequest) -> str:
    """Say that a stream is not there yet."""
    return f"{request} is not on the network: start it, and check that LSL is enabled"


class FreePorts:
    """Free ports of liblsl's range, counted seldom: who counts has each of them for a moment."""

    def __init__(self) -> None:
        self._count = 0
        self._due = float("-inf")

    def __call__(self) -> int:
        """Return how many were free when they were last counted."""
        if (now := time.monotonic()) >= self._due:
            self._due = now + PATIENCE_S
            self._count = free_ports()
        return self._count


def missed(
    request: StreamRequest, seen: "Sequence[pylsl.StreamInfo]", free: Callable[[], int]
) -> str:
    """Say why a stream is still not there, as far as this computer can tell.

    Parameters
    ----------
    request
        What is waited for.
    seen
        All streams that a search finds.
    free
        Tells how many ports of liblsl's range are free.
    """
    try:
        why = cause(seen, describe(), free(), port_range())
    except StreamError as error:  # of the configuration, which liblsl has read before
        why = str(error)
    return f"{request} is not on the network after {PATIENCE_S:g} s: {why}"


def cause(
    seen: "Sequence[pylsl.StreamInfo]", network: Network, free: int, ports: Sequence[int]
) -> str:
    """Return what keeps a stream from being found, the surest first.

    A search takes a port of liblsl's range; without one it hears no answer, and says nothing.
    """
    if not free:
        return (
            f"none of LSL's {len(ports)} ports, {ports[0]} to {ports[-1]}, is free, so "
            "no stream can be searched for; end programs that search continuously, or set "
            "PortRange = 128 in lsl_api.cfg (docs/lab.md)"
        )
    others = sorted(
        f"{one.name()!r} ({one.type()}, source_id {one.source_id()!r}) of {one.hostname()}"
        for one in seen
        if not one.name().startswith(OURS)
    )
    if others:
        return (
            f"the network has {shortened(others, MOST_NAMED)}; correct the protocol if "
            "one of them is meant, otherwise start its program; labcrane doctor --peer ADDRESS "
            "shows whether a firewall blocks it"
        )
    if network.loopback:
        return (
            f"no stream is, and {network}; drop --local for streams of other computers; otherwise "
            "start its program"
        )
    return (
        "no stream of another program is, so that LSL may be blocked; labcrane doctor --peer "
        "ADDRESS shows whether a firewall blocks it, there or here (UDP 16571, and UDP and TCP "
        f"{ports[0]} to {ports[-1]})"
    )
