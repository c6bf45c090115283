"""All feedback processes of a run."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace

from labcrane.core.records import Run
from labcrane.design.seeds import derive
from labcrane.errors import DeviceError
from labcrane.feedback.config import ComponentConfig, FeedbackConfig
from labcrane.feedback.delays import read_delays
from labcrane.feedback.handle import FeedbackHandle
from labcrane.protocol.components import ComponentSpec
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study
from labcrane.session.commands import FeedbackLost, FeedbackReady
from labcrane.session.visit import Visit
from labcrane.streams.feedback_log import log_source
from labcrane.streams.request import StreamRequest

LOOK_S = 0.05


class FeedbackProcesses:
    """Starts, watches and stops the views and sounds of a visit."""

    def __init__(self, visit: Visit) -> None:
        policy = visit.study.protocol.on_fault.feedback_lost
        self._required = policy != "continue"
        self.handles = [FeedbackHandle(order, policy) for order in _orders_of(visit)]
        self._news: list[FeedbackLost | FeedbackReady] = []

    def wait(self, say: Callable[[str], None], ended: Callable[[], bool]) -> bool:
        """Wait until all are ready or left out; whether the session may start.

        Raises
        ------
        DeviceError
            One cannot be started, and the protocol does not allow the session without it.
        """
        while not all(handle.ready or handle.given_up for handle in self.handles):
            for handle in self.handles:
                if not (why := handle.failure):
                    continue
                if self._required:
                    raise DeviceError(
                        f"feedback {handle.name!r} cannot be started: {why} (on_fault: "
                        "{feedback_lost: continue} would continue without it)"
                    )
                self._news += (news := handle.watch())
                for report in news:
                    say(f"feedback {report}")
            if ended():
                return False
            time.sleep(LOOK_S)
        return True

    def watch(self, say: Callable[[str], None]) -> list[FeedbackLost | FeedbackReady]:
        """Check all processes; return what to report to the session, also about its start."""
        news = [report for handle in self.handles for report in handle.watch()]
        for report in news:
            say(f"feedback {report}")
        before, self._news = self._news, []
        return before + news

    def again(self, name: str) -> None:
        """Start a view or sound again that is left out; nothing for any other name."""
        for handle in self.handles:
            if handle.name == name:
                handle.again()

    @property
    def sends(self) -> tuple[str, ...]:
        """The descriptions of all streams in which feedback reports its presentation."""
        return tuple(text for handle in self.handles for text in handle.sends)

    def offer(self, streams: Mapping[str, str]) -> None:
        """Tell all processes the session's streams, by name and description."""
        for handle in self.handles:
            handle.offer(streams)

    def stop(self) -> None:
        """Stop all processes."""
        for handle in self.handles:
            handle.stop()


def host_orders(study: Study, run: Run, source: str) -> list[FeedbackConfig]:
    """Return the configurations of a study's feedback processes for the streams of ``source``."""
    cues = {name: _part(choice) for name, choice in study.cues.items()}
    views = {name: _part(choice) for name, choice in study.views.items()}
    parts = list(views.values())
    return [
        *(
            FeedbackConfig(
                name,
                part,
                run,
                source,
                study.path,
                always=True,
                cues=cues,
                title=study.window_title(name),
                before=tuple(parts[:number]),
            )
            for number, (name, part) in enumerate(views.items())
        ),
        *(
            FeedbackConfig(name, _part(choice), run, source, study.path, always=False)
            for name, choice in study.sounds.items()
        ),
    ]


def _orders_of(visit: Visit) -> list[FeedbackConfig]:
    study = visit.study
    if not (study.sounds or study.views):
        return []
    seed = derive(study.protocol.study, visit.participant)
    run = Rig.build(study, simulated=visit.simulated).describe(study, seed)
    known = read_delays(study.path)
    orders = host_orders(study, run, visit.source)
    return [replace(order, measured=known.get(order.name)) for order in orders]


def log_requests(visit: Visit) -> list[StreamRequest]:
    """Return the requests to the recorder: the streams in which feedback reports."""
    study = visit.study
    found = []
    for name, choice in {**study.views, **study.sounds}.items():
        feedback = choice.build(study.machine)
        streams = ("", *getattr(feedback, "streams", {}))
        for stream in streams:
            label = f"{name}.{stream}" if stream else name
            wanted = log_source(visit.source, name, stream)
            found.append(StreamRequest(label=label, source_id=wanted, required=False))
    return found


def cameras_of(study: Study) -> dict[str, tuple[str, ...]]:
    """Return the names of the cameras whose pictures the experimenter receives, by feedback."""
    chosen = {**study.views, **study.sounds}
    built = {name: choice.build(study.machine) for name, choice in chosen.items()}
    named = {name: getattr(feedback, "cameras", ()) for name, feedback in built.items()}
    return {name: cameras for name, cameras in named.items() if cameras}


def _part(choice: ComponentSpec) -> ComponentConfig:
    return ComponentConfig(choice.name, choice.settings.model_dump(mode="json"))
