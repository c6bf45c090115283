"""A feedback process: one view or sound, fed with the newest frame.

``python -m labcrane.feedback_host`` reads its order, one line of JSON, from the standard input and
ends when that is closed or says ``stop``. It reports on its standard output, a line of JSON each
time: ``ready`` with the component's facts, ``beat`` while it lives, ``failed`` with the reason.
"""

import json
import os
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TextIO, TypeVar

import numpy as np

from labcrane.culprit import told
from labcrane.delay_file import delay_in_words
from labcrane.errors import LabcraneError
from labcrane.host_order import HostOrder, Part
from labcrane.oversight import promised
from labcrane.records import Frame, Situation, Value
from labcrane.registry import Registry, discover
from labcrane.roles import Component, Cue, Feedback
from labcrane.signals import FloatArray, Layout

if TYPE_CHECKING:
    import pylsl

    from labcrane.streams.feedback_log import FeedbackLog

RoleT = TypeVar("RoleT", bound=Component)

WAIT_S = 0.05
BEAT_S = 0.2


class Presenter:
    """Presents frames with one feedback component and the cues it draws.

    Used by the process below, and without it by previews and tests.
    """

    def __init__(self, order: HostOrder, registry: Registry) -> None:
        self._order = order
        self._registry = registry
        self._situation = Situation()
        self._resting = True
        self.feedback = self._built(Feedback, order.name, order.part)
        self.cues = {name: self._built(Cue, name, part) for name, part in order.cues.items()}

    @property
    def layout(self) -> Layout:
        """What :meth:`present` returns: the component's signals, then those of every cue."""
        cues = (
            replace(signal, name=f"cue.{name}.{signal.name}")
            for name, cue in self.cues.items()
            for signal in cue.signals
        )
        return Layout(self._order.name, (*self.feedback.signals, *cues))

    @property
    def facts(self) -> dict[str, Value]:
        """What the record should know of the open component, and of its delay."""
        facts = dict(self.feedback.facts())
        return {**facts, "delay": delay_in_words(self._order.measured, facts)}

    def open(self) -> None:
        """Open everything; raises what the components raise."""
        for component in (*self.cues.values(), self.feedback):
            component.open(self._order.run)
        self.feedback.hear(self._situation)

    def close(self) -> None:
        """Close everything."""
        for component in (self.feedback, *self.cues.values()):
            component.close()

    def hear(self, situation: Situation) -> None:
        """Take up a new situation; what has new settings is built anew with them."""
        before, self._situation = self._situation, situation
        for name in {*situation.settings, *before.settings}:
            if situation.settings.get(name) != before.settings.get(name):
                self._rebuild(name)
        self.feedback.hear(situation)

    def present(self, frame: Frame) -> FloatArray | None:
        """Present a frame; return what was presented, or None while switched off."""
        active = self._situation.active
        if not self._order.always and self._order.name not in active:
            if not self._resting:
                self.feedback.rest()
                self._resting = True
            return None
        self._resting = False
        values = []
        shapes: list[Any] = []
        for name, cue in self.cues.items():
            if name in active and frame.trial:
                shapes += cue.draw(frame)
                values.append(promised(f"cue {name!r}", cue.signals, cue.values, frame))
            else:
                values.append(np.full(Layout(name, cue.signals).size, np.nan))
        frame.shapes = tuple(shapes)
        said = f"feedback {self._order.name!r}"
        shown = promised(said, self.feedback.signals, self.feedback.present, frame)
        return np.concatenate([shown, *values])

    def _rebuild(self, name: str) -> None:
        if name in self.cues:
            self.cues[name].close()
            self.cues[name] = self._built(Cue, name, self._order.cues[name])
            self.cues[name].open(self._order.run)
        elif name == self._order.name:
            self.feedback.close()
            self.feedback = self._built(Feedback, name, self._order.part)
            self.feedback.open(self._order.run)

    def _built(self, role: type[RoleT], name: str, part: Part) -> RoleT:
        offer = self._registry.find(role, part.use)
        settings = {**part.settings, **self._situation.settings.get(name, {})}
        return offer.build(offer.settings.model_validate(settings), self._order.run.machine)


class FeedbackProcess:
    """Follows a session's streams until it is told to stop."""

    def __init__(self, order: HostOrder, say: Callable[[dict[str, Any]], None]) -> None:
        self._order = order
        self._say = say
        self._stop = threading.Event()
        self._beaten = 0.0
        self._presented = 0

    def stop(self) -> None:
        """Stop after the frame under way."""
        self._stop.set()

    def run(self) -> None:
        """Present until stopped; raises what the component raises."""
        from labcrane.streams.context import CONTEXT, ContextInlet  # noqa: PLC0415 - liblsl
        from labcrane.streams.feedback_log import FeedbackLog  # noqa: PLC0415
        from labcrane.streams.frames import FRAME, FrameInlet  # noqa: PLC0415

        presenter = Presenter(self._order, discover(study=self._order.study))
        try:
            presenter.open()
            log = FeedbackLog(self._order.name, self._order.source, presenter)
            self._say({"ready": True, "facts": presenter.facts})
            if (info := self._found(CONTEXT)) is None:
                return
            context = ContextInlet(info)
            if (info := self._found(FRAME)) is None:
                return
            frames = FrameInlet(info, self._order.run)
            while not self._stop.is_set():
                if context.changed():
                    presenter.hear(context.situation)
                if (frame := frames.newest(WAIT_S)) is not None:
                    self._present(presenter, frame, log, frames.skipped)
                self._beat(frames.skipped)
            log.close()
        finally:
            presenter.close()

    def _present(
        self, presenter: Presenter, frame: Frame, log: "FeedbackLog", skipped: int
    ) -> None:
        values = presenter.present(frame)
        if values is None:
            return
        log.push(frame, values, skipped, presenter.feedback.samples())
        self._presented += 1

    def _found(self, name: str) -> "pylsl.StreamInfo | None":
        """Wait for one of the session's streams; None when stopped first."""
        import pylsl  # noqa: PLC0415

        from labcrane.streams.outlets import source_id  # noqa: PLC0415

        wanted = source_id(self._order.source, name)
        while not self._stop.is_set():
            self._beat(0)
            if found := pylsl.resolve_byprop("source_id", wanted, 1, timeout=0.5):
                return found[0]
        return None

    def _beat(self, skipped: int) -> None:
        now = time.monotonic()
        if now - self._beaten >= BEAT_S:
            self._beaten = now
            self._say({"beat": self._presented, "skipped": skipped})


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
    process = FeedbackProcess(HostOrder.from_json(sys.stdin.readline()), say)

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
