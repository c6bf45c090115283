"""Keys typed at a terminal, and lines of a pipe, read as each system allows.

A waiting caller checks regularly whether it is over: nothing here blocks in a call that only
another key can end; where that cannot be avoided, a thread that blocks nothing else does.
"""

import codecs
import os
import queue
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

POLL_S = 0.1


def lines(over: threading.Event) -> Iterator[str]:
    """Yield the lines of the standard input, without blanks around them, until its end."""
    text = b""
    # Read past sys.stdin, whose buffer would keep the second of two lines from being seen.
    for more in _chunks(sys.stdin.fileno(), over):
        *whole, text = (text + more).split(b"\n")
        for line in whole:
            yield line.decode(errors="replace").strip()
    if not over.is_set():
        yield text.decode(errors="replace").strip()  # the last one may have no end


def from_terminal() -> bool:
    """Return whether a person types the standard input; Windows calls its NUL a terminal, too."""
    return sys.stdin.isatty() and _is_console(sys.stdin)


def chunks_by_thread(descriptor: int, over: threading.Event) -> Iterator[bytes]:
    """Yield what comes, until the end or until it is over; a thread waits for it.

    The thread is left to wait when it is over, and ends with the process at the latest: what comes
    then is lost, so it is for systems only that cannot ask a pipe whether something is there.
    """
    found: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def read() -> None:
        with suppress(OSError):
            while more := os.read(descriptor, 4096):
                found.put(more)
        found.put(b"")

    threading.Thread(target=read, name="standard input", daemon=True).start()
    while not over.is_set():
        with suppress(queue.Empty):
            if not (more := found.get(timeout=POLL_S)):
                return
            yield more


if sys.platform == "win32":
    import _thread
    import ctypes
    import msvcrt

    _chunks = chunks_by_thread

    PREFIXES = ("\0", "\xe0")
    """Prefixes of the number of a key that is not a letter: an arrow, F1."""

    INTERRUPT = "\x03"

    def _is_console(stream: TextIO) -> bool:
        try:
            handle = msvcrt.get_osfhandle(stream.fileno())
        except OSError:
            return True  # a program's own terminal has no handle
        return bool(ctypes.windll.kernel32.GetConsoleMode(handle, ctypes.byref(ctypes.c_uint32())))

    @contextmanager
    def single_keys() -> Iterator[None]:
        """Put the terminal into single-key mode: a Windows console needs no setting for it."""
        yield

    def next_key(over: threading.Event) -> str:
        """Wait for a key; nothing when it is over."""
        while not over.is_set():
            if not msvcrt.kbhit():
                over.wait(POLL_S)
                continue
            key = msvcrt.getwch()
            if key in PREFIXES and msvcrt.kbhit():  # 0xe0 alone is the letter à
                msvcrt.getwch()
            elif key == INTERRUPT:
                _thread.interrupt_main()
            elif "\ud800" <= key < "\udc00":  # the first half of a letter of two
                both = (key + msvcrt.getwch()).encode("utf-16-le", "surrogatepass")
                return both.decode("utf-16-le", "replace")
            else:
                return key
        return ""

else:
    import select
    import termios
    import tty

    def _is_console(stream: TextIO) -> bool:
        return True

    def _chunks(descriptor: int, over: threading.Event) -> Iterator[bytes]:
        """Yield what comes, until the end or until it is over."""
        while not over.is_set():
            if select.select([descriptor], [], [], POLL_S)[0]:
                if not (more := os.read(descriptor, 4096)):
                    return
                yield more

    @contextmanager
    def single_keys() -> Iterator[None]:
        """Put the terminal into single-key mode, and restore it afterwards."""
        before = termios.tcgetattr(sys.stdin)
        try:
            tty.setcbreak(sys.stdin)
            yield
        finally:
            with suppress(termios.error):
                termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)

    def next_key(over: threading.Event) -> str:
        """Wait for a key; return nothing when it is over or the terminal is gone.

        Bypass the buffer of sys.stdin: select does not see what that holds back.
        """
        letters = codecs.getincrementaldecoder("utf-8")(errors="replace")
        key = ""
        while not key and not over.is_set():
            if select.select([sys.stdin], [], [], POLL_S)[0]:
                try:
                    byte = os.read(sys.stdin.fileno(), 1)
                except OSError:  # a terminal that was hung up
                    byte = b""
                if not byte:
                    return ""
                key = letters.decode(byte)  # nothing while the rest of a letter is to come
        return key
