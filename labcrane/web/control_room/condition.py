"""Condition of a session: its state, and one status light with its reason in words."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from labcrane.analysis.presented import PresentedLimits
from labcrane.recording.pictures import LOG
from labcrane.session.standing import EXAMINER, STOP, SessionStage, Standing
from labcrane.web.live import Live
from labcrane.web.state import OpenFault, SessionView

SILENT_S = 1.0
"""A running session sends frames continuously; without one for so long, the page reports it."""

FIRST_S = 2.0
"""How long after a trial's start the first frame may come: the page must find the stream."""

STATES: Mapping[str, str] = {
    "starting": "Getting ready",
    "consent": "Waiting for consent",
    "waiting": "Ready to start",
    "running": "",
    "paused": "Paused",
    "fault": "Stopped by a fault",
    "break": "Break",
    "fixation": "Eye tracker check",
    "questionnaire": "Questionnaire",
    "decision": "A decision is needed",
    "judgement": "Waiting for your judgement",
    "between": "Between two steps",
    "ended": "Ended",
}
"""States of a session with their large headings; that of a running trial is the trial's name."""


@dataclass(frozen=True, slots=True)
class Lamp:
    """Status light: ``"ok"``, ``"warn"`` or ``"bad"``, the reason, and the remedy."""

    level: str
    reason: str
    remedy: str = ""


REMEDIES: Mapping[str, str] = {
    "trigger": "plug the device in",
    "input": "check the controls' cable and power",
    "disk": "free space or reconnect the disk",
    "stream": "check the device and its program",
    "asked": "choose with the buttons next to it",
    "picture": "pause; check the operator's window, the graphics driver and other programs",
}
"""What to do about each kind of fault, except that of a view or sound."""

MEANWHILE: Mapping[str, str] = {
    "trigger": "keeps its codes in the record and goes on",
    "input": "holds the machine at rest, and goes on when they are back",
    "disk": "keeps all data in memory, and goes on when it is back",
    "stream": "keeps searching for it",
}
"""What labcrane does about it."""


def handled(fault: OpenFault, standing: Standing) -> tuple[str, str]:
    """Return what labcrane does about a fault, and what people can do."""
    if fault.kind != "feedback":
        return MEANWHILE[fault.kind], REMEDIES[fault.kind]
    if standing.failed.get(fault.name):
        does = f"has given up after {fault.attempts or 'all'} attempts"
        todo = "start it again, go on without it, or end the session"
    else:
        of = f" of {fault.attempts}" if fault.attempts else ""
        does, todo = f"starts it again: attempt {fault.attempt or 1}{of}", "wait until it is back"
    if fault.accepted:
        does, todo = f"{does}; goes on without it", "start it again when you can"
    return does, todo


def state_of(view: SessionView) -> str:
    """Return which of :data:`STATES` a session is in."""
    standing = view.standing
    if view.over:
        return "ended"
    if standing.stage is SessionStage.CONSENT:
        return "consent"
    if STOP in standing.holds:
        return "decision"
    if standing.holds - {EXAMINER}:
        return "fault"
    if EXAMINER in standing.holds:
        return "paused"
    if standing.trial:
        return "running"
    if standing.stage is SessionStage.BETWEEN and standing.awaited:
        return "starting"
    return str(standing.stage)


@dataclass(frozen=True, slots=True)
class ExpectedSession:
    """The streams and views that a running study must deliver.

    Attributes
    ----------
    period_s
        From one tick to the next, in seconds.
    views
        Names of the operator's views.
    presented
        How much they must show.
    streams
        The study's names for the external streams.
    """

    period_s: float
    views: Sequence[str] = ()
    presented: PresentedLimits = field(default_factory=PresentedLimits)
    streams: Sequence[str] = ()


def lamp_of(view: SessionView, live: Live, expected: ExpectedSession, trouble: str = "") -> Lamp:
    """Return the status light of a session: the worst of its problems.

    ``trouble`` is why the session's data cannot be drawn; empty if they can be.
    """
    if state_of(view) == "ended":
        return _at_the_end(view)
    if view.alarm:
        return Lamp("bad", view.alarm, "decide with the participant")
    found = [
        *_of_faults(view),
        *_of_frames(view, live),
        *_of_pictures(view, expected),
        *_of_streams(view, expected),
        *_of_the_loop(live, expected.period_s),
    ]
    if trouble:
        why = f"this display may be wrong: {trouble}"
        found.append(
            Lamp(
                "warn",
                why,
                "the session and its views continue; report it to your labcrane maintainer",
            )
        )
    worst = [one for one in found if one.level == "bad"] or found
    if worst:
        more = f" (and {len(worst) - 1} more)" if len(worst) > 1 else ""
        return replace(worst[0], reason=worst[0].reason + more)
    paused = EXAMINER in view.standing.holds
    return Lamp("ok", "paused by you; all is well" if paused else "all is well")


def _of_faults(view: SessionView) -> Iterator[Lamp]:
    for fault in view.faults.values():
        does, todo = handled(fault, view.standing)
        yield Lamp("warn" if fault.accepted else "bad", fault.why, f"{todo}; labcrane {does}")


def _at_the_end(view: SessionView) -> Lamp:
    ended = view.ended
    if ended is None:
        return Lamp("ok", "the session is being saved", "leave the computer on")
    return Lamp(ended.level, ended.verdict, ended.remedy)


def _of_frames(view: SessionView, live: Live) -> Iterator[Lamp]:
    """Yield a problem if no frames arrive; the first one may take a while after a trial starts."""
    silent, patience = live.silent_s, SILENT_S
    if silent is None:
        silent, patience = time.perf_counter() - view.trial_began, FIRST_S
    if view.trial and silent > patience:
        yield Lamp(
            "bad", f"no frame from the session for {silent:.0f} s", "look at the terminal; a "
            "session that hangs is ended and saved automatically",
        )  # fmt: skip


def _under_way(view: SessionView) -> bool:
    """Whether a trial has run for so long that all streams must have arrived."""
    return bool(view.trial) and time.perf_counter() - view.trial_began >= FIRST_S


def shown_badly(view: SessionView, expected: ExpectedSession) -> dict[str, str]:
    """Return what is wrong with the operator's views while a trial runs, by their names."""
    views = {LOG + name: name for name in expected.views} if _under_way(view) else {}
    found = {}
    for stream in view.streams.get("streams", ()):
        if name := views.get(str(stream.get("source_id", "")).rpartition("/")[2]):
            found[name] = expected.presented.complaint(stream["rate_hz"], stream["silent_s"])
    return {name: why for name, why in found.items() if why}


def _of_pictures(view: SessionView, expected: ExpectedSession) -> Iterator[Lamp]:
    for name, why in shown_badly(view, expected).items():
        yield Lamp("bad", f"the operator's view {name} {why}", REMEDIES["picture"])


def _of_streams(view: SessionView, expected: ExpectedSession) -> list[Lamp]:
    found = []
    if not view.streams and expected.streams and _under_way(view):
        unknown = f"no data on the streams {', '.join(expected.streams)}"
        found.append(Lamp("bad", unknown, REMEDIES["stream"]))
    for stream in view.streams.get("streams", ()):
        label, condition = stream["label"], stream["condition"]
        if stream.get("required") and condition in {"absent", "silent"}:
            found.append(Lamp("bad", f"stream {label} is {condition}", REMEDIES["stream"]))
        elif condition == "asked about":
            asked = f"stream {label} {stream['warnings'][0]}"
            found.append(Lamp("warn", asked, REMEDIES["asked"]))
        elif stream["warnings"]:
            found.append(Lamp("warn", f"stream {label} {stream['warnings'][0]}"))
        elif stream["signals"]:
            found.append(Lamp("warn", f"signal of {label}: {stream['signals'][0]['message']}"))
    return found


def _of_the_loop(live: Live, period_s: float) -> list[Lamp]:
    late = live.lateness_s
    if late is None or late <= period_s:
        return []
    return [
        Lamp(
            "warn", f"the loop was {1000 * late:.0f} ms late in the last second; a tick lasts "
            f"{1000 * period_s:.1f} ms", "close other programs on this computer",
        )
    ]  # fmt: skip
