"""Ports for LSL that no other run of tests on this computer has."""

import os
import socket

FIRST, LAST = 16_800, 32_199
"""From beyond liblsl's own to where systems begin to give ports to whoever asks."""

LENGTH = 140
"""One for searches, 128 for streams, and the last to claim the block with."""


def claim(first: int | None = None) -> tuple[int, socket.socket]:
    """Return the first port of a free block, and what holds it until it is closed.

    The last port of the block is bound. The system frees it when this process ends, however it
    ends, and child processes do not inherit it.

    Parameters
    ----------
    first
        Where to begin to look; by default by the process's number, so that runs that start
        together seldom meet.

    Raises
    ------
    RuntimeError
        When every block is taken.
    """
    blocks = range(FIRST, LAST - LENGTH + 2, LENGTH)
    begin = os.getpid() % len(blocks) if first is None else blocks.index(first)
    for block in (*blocks[begin:], *blocks[:begin]):
        holder = socket.socket()
        if os.name == "nt":
            holder.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
        try:
            holder.bind(("127.0.0.1", block + LENGTH - 1))
        except OSError:  # another run's, or another program's
            holder.close()
            continue
        return block, holder
    raise RuntimeError(
        f"no block of {LENGTH} ports is free from {FIRST} to {LAST}; end other runs of the tests"
    )
