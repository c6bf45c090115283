"""Presentation of movements: what the operator was shown of each, and whether that was too little.

A view records when each picture was shown (``labcrane.feedback.NAME``), and the session when a view
or sound failed and was back. Status light, sync report and results use :class:`PresentedLimits`.

Such a movement is left out of means. A mean rate over the movement would hide slow seconds; from
the onset on, an invisible target would be a slow reaction; analyses would ignore a warning.
"""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pydantic import PositiveFloat

from labcrane.core.findings import Finding, Verdict
from labcrane.core.settings import Settings
from labcrane.errors import shortened
from labcrane.recording.labels import Attempt, attempt_of
from labcrane.recording.pictures import LOG, RATE_S

if TYPE_CHECKING:  # a protocol is checked without loading what computes
    import pandas as pd

    from labcrane.recording.participant_file.reader import SessionRecord
    from labcrane.types import FloatArray

SILENT_S = 2.0
"""The recorder reports on streams once a second: after this time a hanging view is distinguished
from one without a report so far."""

ROUNDING_S = 1e-6
"""A picture exactly a second after another one is within that second."""

FAILED = 0.05
"""Share of a session's movements above which the data need a check, not only the report."""

NAMED = 6
"""Movements named one by one in a sentence."""


class PresentedLimits(Settings):
    """How much of a movement the operator must have been shown; with less it is excluded."""

    min_hz: PositiveFloat = 15.0
    """Fewest pictures in any one second of the movement; a shorter movement is judged whole. Below
    about 15, people steer and place measurably worse (Chen and Thropp, 2007, IEEE Transactions on
    Systems, Man, and Cybernetics A 37, 1063-1076); a processor that draws reaches 25."""

    max_gap_s: PositiveFloat = 0.25
    """Longest time without a new picture, or with a sound that had failed, in seconds: about a
    visual reaction time. A second without a picture is too little by `min_hz` in any case. If the
    session stalls for longer, the movement is interrupted."""

    def too_little(self, rate_hz: float, longest_s: float) -> bool:
        """Whether a rate in the worst second, or a time without a picture, is insufficient."""
        return rate_hz < self.min_hz or longest_s > self.max_gap_s

    def complaint(self, rate_hz: float | None, silent_s: float | None) -> str:
        """Return the present fault of a view during a movement; empty if there is none.

        Parameters
        ----------
        rate_hz
            Pictures in the last second; None where it is not known.
        silent_s
            Time since the last picture, in seconds; None before the first.
        """
        if silent_s is None:
            return "has shown no picture yet"
        if silent_s > max(SILENT_S, self.max_gap_s) or rate_hz == 0.0:
            return f"has shown no picture for {silent_s:.0f} s"
        if rate_hz is not None and rate_hz < self.min_hz:
            return f"shows {rate_hz:.1f} pictures a second, and {self.min_hz:g} are needed"
        return ""


PRESENTED: Mapping[str, tuple[str, str]] = {
    "pictures": (
        "1",
        "pictures that the operator's view showed from the trial's start to its end, without "
        "pauses; with several views, the smallest number",
    ),
    "fewest_pictures": (
        "Hz",
        "smallest number of pictures in any one second, without pauses; for a shorter trial, "
        "pictures per second",
    ),
    "longest_without_picture": (
        "s",
        "longest time without a new picture, without pauses; includes the times from the start to "
        "the first picture and from the last one to the end",
    ),
    "feedback_lost": (
        "s",
        "how long a view of the operator, or an active sound, had failed, also while the session "
        "was paused for it",
    ),
    "presentation_failed": (
        "1",
        "1 where that is less than presented: in the protocol requires; averages exclude it",
    ),
}
"""Unit and meaning of the columns of :func:`presented`."""


def operators_views(components: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the names of the views that are on a screen before the operator.

    Parameters
    ----------
    components
        Components of a study in its record: ``views.NAME`` with settings.
    """
    found = []
    for part, choice in components.items():
        kind, _, name = part.partition(".")
        settings = choice.get("settings", {})
        others = settings.get("seen_by", "operator") != "operator"
        if kind == "views" and not others and settings.get("display") != "hidden":
            found.append(name)
    return found


def presented(session: "SessionRecord") -> "pd.DataFrame | None":
    """Return what the operator was shown of each movement, in the rows of the trial table.

    None if nothing was to be shown: the study has no view or sound for the operator, or the
    session was run without them. A view that never showed a picture has shown 0.
    """
    import numpy as np
    import pandas as pd

    trials, events = session.trials, session.events
    components = session.context.get("components", {})
    views = operators_views(components)
    own = {
        *views,
        *(part.removeprefix("feedback.") for part in components if part.startswith("feedback.")),
    }
    told = events[events["name"].isin(["feedback.lost", "feedback.ready"])]
    started = {str(data["what"]) for data in told["data"]}
    views = [name for name in views if name in started or LOG + name in session.streams]
    if trials.empty or not (views or own & started):
        return None
    clock = _Clock(session)
    spans = [clock.at(trials[edge].to_numpy(float)) for edge in ("started", "ended")]
    table = pd.DataFrame(index=trials.index, columns=list(PRESENTED), dtype=float)
    on = [own & {*views, *names} for names in _switched_on(trials, own)]
    # In a pause the machine is held, so missing pictures do no harm to the movement; the
    # interruption is reported.
    table["feedback_lost"] = _lost(told, on, trials["started"], trials["ended"])
    silent = _lost(told, [names - {*views} for names in on], spans[0], spans[1], clock)
    limits = _limits(session)
    failed = np.array(silent) > limits.max_gap_s
    if views:
        shown = [_shown(session, name, clock, *spans) for name in views]
        counts, fewest, longest = (np.array(each) for each in zip(*shown, strict=True))
        table["pictures"] = counts.min(axis=0)
        table["fewest_pictures"] = fewest.min(axis=0)
        table["longest_without_picture"] = longest.max(axis=0)
        failed |= [
            limits.too_little(rate, gap)
            for rate, gap in zip(
                table["fewest_pictures"], table["longest_without_picture"], strict=True
            )
        ]
    table["presentation_failed"] = failed.astype(float)
    return table


class _Clock:
    """Time of a session without its pauses, in seconds."""

    def __init__(self, session: "SessionRecord") -> None:
        import numpy as np

        loop = session.streams["loop"].columns(("due", "paused"))
        self.rate_hz = float(session.attrs["rate_hz"])
        self._due, self._held = loop["due"], loop["paused"] != 0.0
        before = np.cumsum(~self._held) - ~self._held
        self._running = before / self.rate_hz

    def at(self, times: "FloatArray | Sequence[float]") -> "FloatArray":
        """Return the time without pauses at times on the session's clock."""
        import numpy as np

        return np.asarray(np.interp(times, self._due, self._running))

    def running(self, times: "FloatArray") -> "FloatArray":
        """Return the same for those times that are in the session and not in a pause."""
        import numpy as np

        times = times[(times >= self._due[0]) & (times <= self._due[-1])]
        tick = np.searchsorted(self._due, times, side="right") - 1
        return self.at(times[~self._held[tick]])


def _shown(
    session: "SessionRecord", name: str, clock: _Clock, since: "FloatArray", until: "FloatArray"
) -> "tuple[list[int], list[float], list[float]]":
    """Return the pictures that a view showed in each movement, and the worst values.

    These are the lowest rate per second, and the longest time without a picture.
    """
    import numpy as np

    stream = session.streams.get(LOG + name)
    shown = clock.running(np.empty(0) if stream is None else np.sort(stream.time))
    edges = np.searchsorted(shown, since), np.searchsorted(shown, until, side="right")
    counts, fewest, gaps = [], [], []
    for first, last, began, over in zip(*edges, since, until, strict=True):
        own = shown[first:last]
        counts.append(len(own))
        fewest.append(_fewest(own, began, max(over, began + 1.0 / clock.rate_hz)))
        gaps.append(float(np.diff(np.r_[began, own, over]).max()))
    return counts, fewest, gaps


def _fewest(shown: "FloatArray", began: float, over: float) -> float:
    """Return pictures a second in the worst ``RATE_S`` from ``began`` to ``over``.

    A stretch has fewest where it begins just after a picture, or where the movement does.
    """
    import numpy as np

    if over - began <= RATE_S:
        return len(shown) / (over - began)
    after = np.flatnonzero(shown + RATE_S <= over)
    until = np.searchsorted(shown, shown[after] + RATE_S + ROUNDING_S, side="right")
    first = np.searchsorted(shown, began + RATE_S + ROUNDING_S, side="right")
    return float(min(first, (until - after - 1).min(initial=first)) / RATE_S)


def _switched_on(trials: "pd.DataFrame", sounds: set[str]) -> list[set[str]]:
    """Return the active feedback of each trial; all of it if the record has no list."""
    if "feedback" not in trials:
        return [sounds] * len(trials)
    return [
        set(names.split("+")) if isinstance(names, str) else sounds for names in trials["feedback"]
    ]


def _lost(
    told: "pd.DataFrame",
    names: Sequence[set[str]],
    since: Iterable[float],
    until: Iterable[float],
    clock: _Clock | None = None,
) -> list[float]:
    """Return how long any of the feedback named for each movement had failed, in seconds.

    With a ``clock``, whose times ``since`` and ``until`` then are, pauses are left out.
    """
    outages = {
        frozenset(own): [clock.at(edges) if clock else edges for edges in _outages(told, own)]
        for own in names
    }
    return [
        sum(
            (
                max(0.0, float(min(end, over) - max(start, began)))
                for began, over in outages[frozenset(own)]
            ),
            0.0,
        )
        for own, start, end in zip(names, since, until, strict=True)
    ]


def _outages(told: "pd.DataFrame", own: set[str]) -> list[tuple[float, float]]:
    """Return the spans in which feedback of the operator had failed, on the session's clock."""
    found, lost, began = [], set[str](), 0.0
    for name, time, data in zip(told["name"], told["time"], told["data"], strict=True):
        before = bool(lost)
        if name == "feedback.lost":
            lost |= {str(data["what"])} & own
        else:
            lost.discard(str(data["what"]))
        if lost and not before:
            began = float(time)
        elif before and not lost:
            found.append((began, float(time)))
    return [*found, (began, float("inf"))] if lost else found


def not_presented(movements: "pd.DataFrame") -> "pd.Series[bool]":
    """Return the movements of which the operator was shown too little."""
    import pandas as pd

    if "presentation_failed" not in movements:
        return pd.Series(data=False, index=movements.index, dtype=bool)
    return movements["presentation_failed"] == 1.0


def presentation_failed(session: "SessionRecord") -> dict[Attempt, bool]:
    """Return for each attempt in the trial table whether the operator was shown too little.

    Empty if nothing was to be shown.
    """
    table = presented(session)
    if table is None:
        return {}
    rows = map(attempt_of, session.trials.to_dict("records"))
    return dict(zip(rows, map(bool, not_presented(table)), strict=True))


def in_words(movement: Mapping[Hashable, Any]) -> str:
    """Return what was shown of a movement.

    ``412 pictures shown, 5 in the worst second, none for 0.20 s``.

    Failed feedback is named too: ``feedback lost for 2.50 s``.
    """
    found, gap = [], movement["longest_without_picture"]
    if movement["pictures"] == movement["pictures"]:  # a number: there is a view
        worst = f"{movement['fewest_pictures']:.3g} in the worst second"
        found.append(f"{movement['pictures']:.0f} pictures shown, {worst}, none for {gap:.2f} s")
    if movement["feedback_lost"]:
        found.append(f"feedback lost for {movement['feedback_lost']:.2f} s")
    return ", ".join(found)


def judge_presented(session: "SessionRecord") -> tuple[Finding, ...]:
    """Return the findings on movements of which the operator was shown too little."""
    table = presented(session)
    if table is None or not (failed := not_presented(table)).any():
        return ()
    rows = session.trials[["trial"]].join(table)[failed].to_dict("records")
    text = (
        f"in {len(rows)} of {len(table)} movements the operator saw or heard too little; "
        f"averages exclude them ({_named(rows)})"
    )
    advice = "close other programs, check the graphics driver, or choose a lower quality"
    if any(row["feedback_lost"] for row in rows):
        advice = "the events feedback.lost say why it failed"
    return (
        Finding(Verdict.FAIL if len(rows) > FAILED * len(table) else Verdict.WARN, text, advice),
    )


def judge_interrupted(session: "SessionRecord") -> tuple[Finding, ...]:
    """Return the findings on movements that count although feedback failed in them.

    The session was paused for it and the machine was held, so that nothing moved unseen.
    """
    table = presented(session)
    if table is None:
        return ()
    lost = (table["feedback_lost"] > _limits(session).max_gap_s) & ~not_presented(table)
    rows = session.trials[["trial"]].join(table)[lost].to_dict("records")
    if not rows:
        return ()
    text = (
        f"in {len(rows)} of {len(table)} movements a view or sound had failed while the session "
        f"was paused; they count ({_named(rows)})"
    )
    advice = "exclude them where an interruption matters: feedback_lost in the tables"
    return (Finding(Verdict.WARN, text, advice),)


def _limits(session: "SessionRecord") -> PresentedLimits:
    return PresentedLimits.model_validate(session.context.get("presented", {}))


def _named(rows: Sequence[Mapping[Hashable, Any]]) -> str:
    return shortened([f"trial {row['trial']:g}: {in_words(row)}" for row in rows], NAMED, "; ")
