"""A feedback process: one view or sound, fed with the newest frame.

``python -m labcrane.feedback.process`` reads its order, one line of JSON, from the standard input
and ends when that is closed or says ``stop``. It reports on its standard output, a line of JSON
each time: ``ready`` with the component's metadata, ``presents`` from the first frame on, ``beat``
while it lives, ``failed`` with the reason.
"""

import json
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TextIO

from labcrane.core.records import Frame
from labcrane.errors import LabcraneError
from labcrane.feedback.config import FeedbackConfig
from labcrane.feedback.presenter import Presenter
from labcrane.registry.registry import discover
from labcrane.registry.traceback import told

if TYPE_CHECKING:
    import pylsl

    from labcrane.streams.context import ContextInlet
    from labcrane.streams.feedback_log import FeedbackLog
    from labcrane.streams.frames import FrameInlet
    from labcrane.streams.pictures import PictureOutlet

WAIT_S = 0.05
BEAT_S = 0.2


class FeedbackProcess:
    """Follows a session's streams until it is told to stop."""

    def __init__(self, order: FeedbackConfig, say: Callable[[dict[str, Any]], None]) -> None:
        self._order = order
        self._say = say
        self._stop = threading.Event()
        self._beaten = 0.0
        self._presented = 0
        self._presents = False
        self._resolver: pylsl.ContinuousResolver | None = None
        self._pictures: PictureOutlet | None = None

    def stop(self) -> None:
        """Stop after the frame under way."""
        self._stop.set()

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
        """Wait for what belongs to the first frame: what it is about, and who records it."""
        recorded = self._order.recorded
        while not (self._stop.is_set() or (context.text and (log.taken or not recorded))):
            context.changed(WAIT_S)
            self._beat()

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

        A search in the background: one that waits may take seconds longer than it was told, and
        what is not heard of for so long is killed.
        """
        import pylsl  # noqa: PLC0415

        from labcrane.streams.outlets import source_id  # noqa: PLC0415

        ours = source_id(self._order.source, "")
        # Kept: to end a search takes as long as one that waits.
        self._resolver = pylsl.ContinuousResolver(pred=f"starts-with(source_id, '{ours}')")
        while not self._stop.wait(WAIT_S):
            self._beat()
            found = {info.name(): info for info in self._resolver.results()}
            if all(name in found for name in names):
                return found
        return {}

    def _beat(self) -> None:
        now = time.monotonic()
        if now - self._beaten >= BEAT_S:
            self._beaten = now
            self._say({"beat": self._presented})


def _reporter(status: TextIO) -> Callable[[dict[str, Any]], None]:
    def say(message: dict[str, Any]) -> None:
        try:
            status.write(json.dumps(message) + "\n")
            status.flush()
        except BrokenPipeError:
            pass  # the launcher is gone, and the closed input stops this process

    return say


def main() -> int:
    """Run one feedback process; return its exit status."""
    # Sound and graphics libraries print to the standard output, which is ours for reports.
    status = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    say = _reporter(status)
    process = FeedbackProcess(FeedbackConfig.from_json(sys.stdin.readline()), say)

    def listen() -> None:
        sys.stdin.readline()
        process.stop()

    threading.Thread(target=listen, name="from-launcher", daemon=True).start()
    try:
        process.run()
    except LabcraneError as error:
        say({"failed": str(error)})
        return 1
    except Exception as error:
        say({"failed": told(error)})
        raise  # a plugin's mistake: its author needs the traceback
    return 0


if __name__ == "__main__":
    sys.exit(main())
