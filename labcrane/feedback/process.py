"""A feedback process: one view or sound, fed with the newest frame.

It is started by a :class:`labcrane.processes.handle.ProcessHandle` with a
:class:`labcrane.feedback.config.FeedbackConfig`, receives the session's streams when there are any,
and ends when its parent does. It reports ``ready`` with the component's metadata, ``presents`` from
the first frame on, ``beat`` while it lives, ``failed`` with the reason.
"""

import sys
import threading
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from labcrane.core.records import Frame
from labcrane.errors import StreamError
from labcrane.feedback.config import FeedbackConfig
from labcrane.feedback.presenter import Presenter
from labcrane.processes.parent import Parent, serve
from labcrane.registry.registry import discover

if TYPE_CHECKING:
    import pylsl

    from labcrane.streams.context import ContextInlet
    from labcrane.streams.feedback_log import FeedbackLog
    from labcrane.streams.frames import FrameInlet
    from labcrane.streams.pictures import PictureOutlet

WAIT_S = 0.05
BEAT_S = 0.2
LISTEN_S = 1.0
TAKEN_S = 45.0
"""How long a recorder may take to receive its streams once the session has begun."""


class FeedbackProcess:
    """Follows a session's streams until it is told to stop."""

    def __init__(self, order: FeedbackConfig, say: Callable[[dict[str, Any]], None]) -> None:
        self._order = order
        self._say = say
        self._stop = threading.Event()
        self._beaten = 0.0
        self._presented = 0
        self._presents = False
        self._offered = order.streams
        self._pictures: PictureOutlet | None = None

    def stop(self) -> None:
        """Stop after the frame under way."""
        self._stop.set()

    def offer(self, streams: Mapping[str, str]) -> None:
        """Take the session's streams, by name and description."""
        self._offered = streams

    def run(self) -> None:
        """Present until stopped; raises what the component raises."""
        from labcrane.streams.context import CONTEXT, ContextInlet  # noqa: PLC0415 - liblsl
        from labcrane.streams.feedback_log import FeedbackLog  # noqa: PLC0415
        from labcrane.streams.frames import FRAME, FrameInlet  # noqa: PLC0415
        from labcrane.streams.pictures import PictureOutlet  # noqa: PLC0415

        presenter = Presenter(self._order, discover(study=self._order.study))
        try:
            presenter.open()
            log = FeedbackLog(self._order.name, self._order.source, presenter)
            if presenter.feedback.cameras:
                self._pictures = PictureOutlet(self._order.name, self._order.source)
            self._say({"sends": log.descriptions})
            self._say({"ready": True, "facts": presenter.facts})
            found = self._found(CONTEXT, FRAME)
            if not found:
                return
            context = ContextInlet(found[CONTEXT])
            frames = FrameInlet(found[FRAME], self._order.run)
            self._join(context, log)
            presenter.update(context.situation)
            self._follow(presenter, context, frames, log)
            log.close()
            if self._pictures:
                self._pictures.close()
        finally:
            presenter.close()

    def _join(self, context: "ContextInlet", log: "FeedbackLog") -> None:
        """Wait for the first frame's session state and for the recorder."""
        recorded = self._order.recorded
        since, heard = time.monotonic(), False
        while not (self._stop.is_set() or (context.text and (log.taken or not recorded))):
            context.changed(WAIT_S)
            self._beat()
            if heard != bool(context.text):
                since, heard = time.monotonic(), bool(context.text)
            if time.monotonic() - since > TAKEN_S:
                raise StreamError(unheard(self._order.name, heard=heard))

    def _follow(
        self,
        presenter: Presenter,
        context: "ContextInlet",
        frames: "FrameInlet",
        log: "FeedbackLog",
    ) -> None:
        """Present until stopped."""
        while not self._stop.is_set():
            if context.changed():
                presenter.update(context.situation)
            if (frame := frames.newest(WAIT_S)) is not None:
                self._present(presenter, frame, log, frames.skipped)
                if not self._presents:
                    self._presents = True
                    self._say({"presents": True})
            self._beat()

    def _present(
        self, presenter: Presenter, frame: Frame, log: "FeedbackLog", skipped: int
    ) -> None:
        values = presenter.present(frame)
        if values is None:
            return
        log.push(frame, values, skipped, presenter.feedback.samples())
        self._presented += 1
        if self._pictures and self._pictures.wanted:
            self._pictures.push(presenter.feedback.pictures(), frame.tick.due)

    def _found(self, *names: str) -> "dict[str, pylsl.StreamInfo]":
        """Wait for the session's streams of these names; none when stopped first.

        The launcher sends them; without one, as in a preview, they are searched for.
        """
        from labcrane.streams.outlets import source_id  # noqa: PLC0415 - liblsl
        from labcrane.streams.search import Search, known_stream  # noqa: PLC0415

        ours = source_id(self._order.source, "")
        search = None if self._order.recorded else Search(f"starts-with(source_id, '{ours}')")
        try:
            while not self._stop.wait(WAIT_S):
                self._beat()
                known = {name: known_stream(text) for name, text in self._offered.items()}
                found = {name: info for name, info in known.items() if info is not None}
                found |= {info.name(): info for info in (search.results() if search else ())}
                if all(name in found for name in names):
                    return found
        finally:
            if search:
                search.close()
        return {}

    def _beat(self) -> None:
        now = time.monotonic()
        if now - self._beaten >= BEAT_S:
            self._beaten = now
            self._say({"beat": self._presented})


def unheard(name: str, *, heard: bool) -> str:
    """Report which input of a view or sound is missing, and the likely cause.

    ``heard`` is whether the session's context came.
    """
    if not heard:
        return (
            f"{name!r} found the session's streams but received nothing from them for "
            f"{TAKEN_S:g} s; this computer's firewall blocks TCP to itself: allow the ports that "
            "labcrane doctor names"
        )
    return (
        f"no recorder has received the stream of {name!r} for {TAKEN_S:g} s; "
        "labcrane doctor counts LSL's free ports: if none are left, end other programs "
        "that search or set PortRange = 128 in lsl_api.cfg (docs/lab.md)"
    )


def run(order: str, parent: Parent) -> None:
    """Present until the parent is gone; raises what the component raises."""
    process = FeedbackProcess(FeedbackConfig.from_json(order), parent.tell)

    def listen() -> None:
        while not parent.gone.is_set():
            parent.wait(LISTEN_S)
            for streams in parent.messages():
                process.offer(streams)
        process.stop()

    threading.Thread(target=listen, name="from-launcher", daemon=True).start()
    process.run()


if __name__ == "__main__":
    sys.exit(serve(run))
