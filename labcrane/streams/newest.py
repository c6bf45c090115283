"""Newest sample of a stream of another program, found, lost and found again."""

import atexit
import threading
import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from labcrane.errors import StreamError
from labcrane.streams.probes import ClockProbe, Probe
from labcrane.streams.search import Search, equal, known_stream

if TYPE_CHECKING:
    import pylsl

OPEN_S = 2.0
"""How long a stream that was found may take to tell its description, and to open."""

LOOK_S = 0.2
SILENT_S = 5.0
"""A stream that has sent nothing for so long is looked for: its program may have been replaced."""

MOST = 4096
MOST_A_TICK = 64

_offered: list[str] = []
"""Descriptions of streams that other processes of the run send, without a search; the newest
last."""

_open: "weakref.WeakSet[NewestSample]" = weakref.WeakSet()


class NewestSample:
    """Receives a stream and gives its newest sample; never makes its caller wait for the network.

    A thread looks for the stream, opens it, and looks for it again when its program ends or another
    one takes its place. Stamps are the sender's own, on its clock.

    Parameters
    ----------
    wanted
        What the stream's description says, by property: ``{"name": "panel", "hostname": "lab-2"}``.
    accept
        Is given the description of a stream that was found, before it is received, in the thread.
        It raises :class:`labcrane.StreamError` to say why the stream is of no use.
    buffer_s
        How much is kept while nobody pulls, in seconds.

    Attributes
    ----------
    complaint
        What ``accept`` raised of the stream that was found last; empty when it is received.
    info
        The description of the stream that is received, or was last; None before the first.
    """

    def __init__(
        self,
        wanted: Mapping[str, str],
        accept: "Callable[[pylsl.StreamInfo], None] | None" = None,
        buffer_s: int = 2,
    ) -> None:
        self.complaint = ""
        self.info: pylsl.StreamInfo | None = None
        self._wanted = wanted
        self._tried: set[str] = set()
        self._predicate = equal(**wanted)
        self._accept = accept
        self._buffer_s = buffer_s
        self._inlet: pylsl.StreamInlet | None = None
        self._probe: ClockProbe | None = None
        self._came = time.monotonic()
        self._over = threading.Event()
        self._lost = threading.Event()
        self._connected = threading.Event()
        self._thread = threading.Thread(target=self._keep, name="newest sample", daemon=True)
        self._thread.start()
        _open.add(self)

    @property
    def connected(self) -> bool:
        """Whether the stream is received."""
        return self._inlet is not None

    def wait(self, seconds: float) -> bool:
        """Wait until the stream is received, at most so many seconds; whether it is."""
        return self._connected.wait(seconds)

    def pull(self, most: int = MOST) -> tuple[Sequence[Sequence[Any]], Sequence[float]]:
        """Return the samples that have come since the last call, and their stamps; does not wait.

        Parameters
        ----------
        most
            More than that are left for the next call: no sender can make a call take long.

        Returns
        -------
        tuple
            Samples, oldest first, each with a value for each channel; and stamps in seconds.
        """
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

        if (inlet := self._inlet) is None:
            return [], []
        try:
            samples, stamps = inlet.pull_chunk(timeout=0.0, max_samples=most)
        except pylsl.util.LostError:
            self._inlet = None
            self._lost.set()
            return [], []
        if stamps:
            self._came = time.monotonic()
        return samples, stamps

    def newest(self) -> Sequence[Any] | None:
        """Return the newest sample since the last call; None when none has come. Does not wait."""
        samples, _ = self.pull(MOST_A_TICK)
        return samples[-1] if samples else None

    def clock(self, wait_s: float) -> Probe:
        """Return the newest measurement of its source's clock; waits for the first one.

        Raises
        ------
        StreamError
            Its program does not answer, or is gone.
        """
        probe = self._probe
        if self._inlet is not None and probe is not None:
            probe.new(wait_s)
            if probe.newest is not None:
                return probe.newest
        raise StreamError(
            f"the program of the stream {self._wanted} does not answer; start it again"
        )

    def close(self) -> None:
        """Let go of the stream."""
        self._over.set()
        self._lost.set()
        self._thread.join()
        self._inlet = None

    def _keep(self) -> None:
        """Find, open, and find again, until closed."""
        search: Search | None = None
        while not self._over.is_set():
            quiet = time.monotonic() - self._came > SILENT_S
            if self._inlet is not None and not quiet:
                if search is not None:
                    search.close()
                    search = None
                self._lost.wait(LOOK_S)
                continue
            self._lost.clear()
            if self._inlet is None and (offered := self._of_offered()) is not None:
                self._open(offered)
                continue
            search = search or Search(self._predicate, forget_s=3.0)
            found = search.wait(LOOK_S)
            there = {info.uid() for info in found}
            mine = self.info.uid() if self.info is not None else ""
            if found and (self._inlet is None or mine not in there):
                self._open(found[-1])
            elif self._inlet is not None:
                self._over.wait(LOOK_S)
        if search is not None:
            search.close(patience_s=6.0)

    def _of_offered(self) -> "pylsl.StreamInfo | None":
        """Return the newest offered stream that is wanted and was not tried before."""
        for description in reversed(_offered[:]):
            if description in self._tried or (info := known_stream(description)) is None:
                continue
            if all(getattr(info, key)() == value for key, value in self._wanted.items()):
                self._tried.add(description)
                return info
        return None

    def _open(self, info: "pylsl.StreamInfo") -> None:
        import pylsl  # noqa: PLC0415

        self._inlet = None
        self._connected.clear()
        # Found again by ourselves: liblsl's own search takes ports for as long as it lasts.
        inlet = pylsl.StreamInlet(
            info, max_buflen=self._buffer_s, recover=False, processing_flags=0
        )
        try:
            whole = inlet.info(timeout=OPEN_S)
            if self._accept is not None:
                self._accept(whole)
            inlet.open_stream(timeout=OPEN_S)
        except (StreamError, pylsl.util.TimeoutError, pylsl.util.LostError) as error:
            refused = isinstance(error, StreamError)
            self.complaint = str(error) if refused else f"it was there and is gone again ({error})"
            self._over.wait(LOOK_S)
            return
        self.complaint, self.info, self._came = "", whole, time.monotonic()
        self._probe = ClockProbe(inlet)
        self._inlet = inlet
        self._connected.set()


def offer(description: str) -> None:
    """Say that a process of this computer sends a stream, by its description in XML."""
    _offered.append(description)


def numeric_labels(info: "pylsl.StreamInfo") -> list[str]:
    """Return the labels of the channels of a stream of numbers, in order; those that have one.

    Raises
    ------
    StreamError
        It is of text, or has more labels than channels.
    """
    import pylsl  # noqa: PLC0415

    labels = [str(label) for label in info.get_channel_labels() or []]
    of_text = info.channel_format() == pylsl.cf_string
    if of_text or len(labels) > info.channel_count():
        raise StreamError(
            f"it has {info.channel_count()} channels of {'text' if of_text else 'numbers'}, and "
            f"{len(labels)} labels; send numbers, and a label for each channel"
        )
    return labels


@atexit.register
def _close_all() -> None:
    """Close all before the interpreter ends: liblsl's threads must not outlive it."""
    for each in list(_open):
        each.close()
