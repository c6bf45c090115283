"""Estimates of a session: reports of those that have no value, and that have values again."""

from collections.abc import Callable, Mapping

from labcrane.core.by_estimate import OF_ESTIMATE
from labcrane.core.records import Event, Frame
from labcrane.core.settings import EstimateSettings
from labcrane.core.signals import Layout
from labcrane.protocol.estimated import WORDS, State
from labcrane.recording.frame_log import FrameLog
from labcrane.session.commands import Console

LOST, BACK = "estimate.lost", "estimate.back"


def reporters(
    estimates: Mapping[str, EstimateSettings], axes: Layout, log: FrameLog, console: Console
) -> list[Callable[[Frame], None]]:
    """Return what reports a study's estimates in each tick; none where it has none."""
    return [EstimateReporter(estimates, axes, log, console)] if estimates else []


class EstimateReporter:
    """Notes each change of an estimate's state as an event, and tells the experimenter."""

    def __init__(
        self,
        estimates: Mapping[str, EstimateSettings],
        axes: Layout,
        log: FrameLog,
        console: Console,
    ) -> None:
        self._places = {name: axes.index(f"{OF_ESTIMATE}{name}.state") for name in estimates}
        self._states: dict[str, float | None] = dict.fromkeys(estimates)
        self._log, self._console = log, console

    def __call__(self, frame: Frame) -> None:
        for name, place in self._places.items():
            if (now := frame.axes[place]) == self._states[name]:
                continue
            self._states[name] = state = State(int(now))
            about = {"estimate": name, "state": state.name.lower()}
            if state is not State.OK:
                about["why"] = WORDS[state]
            event = Event(BACK if state is State.OK else LOST, frame.tick.due, about)
            self._log.append(event, frame.tick.number)
            self._console.report(event)
