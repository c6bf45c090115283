"""The present performance indicator, as the experimenter sees it while a test runs."""

import math
from collections.abc import Mapping

from labcrane.analysis.scoring.indicator import Performance, indicate
from labcrane.analysis.scoring.operator_tests import DROPS, completion
from labcrane.analysis.scoring.settings import COUNTS, RATINGS, TIME, IndicatorSettings
from labcrane.core.records import Event, Value

SHARE = "score.share"
LIVE = {name: f"task.mistakes.{name}" for name in COUNTS}
"""The columns of a frame that hold what has been counted so far."""

LIVE_DROPS = "task.mistakes.drop"

WORDS = {
    "object": "objects hit",
    "body": "body hit",
    "overload_max": "overloads, max direction",
    "overload_min": "overloads, min direction",
}


class Assessment:
    """Follows reference stages, tests, ratings and the experimenter's decisions about them.

    Only trials of a task that counts these mistakes are tests. Until the next begins, the one that
    has ended is shown, and orders about it count.
    """

    def __init__(self) -> None:
        self._references: dict[str, dict[int, float]] = {}
        self._about: Mapping[str, Value] = {}
        self._row: Mapping[str, Value] | None = None
        self._flag: float = math.nan
        self._overruled = self._overruled_after = False
        self._ratings: dict[str, float] = {}

    def take(self, event: Event) -> None:
        """Take in the next event."""
        data = event.data
        match event.name:
            case "trial.start":
                self._about, self._row, self._flag = data, None, math.nan
                self._overruled = self._overruled_after = False
                self._ratings = {}
            case "trial.end" if not {TIME, *COUNTS.values()} <= data.keys():
                self._about = {}
            case "trial.end":
                self._row = data
                if data.get("reference") and data["outcome"] == "success":
                    mine = self._references.setdefault(_scene(data), {})
                    mine[int(_number(data["trial"]))] = _number(data[TIME])
            case "order.override" if data.get("refused") is None:
                self._overruled |= not data.get("after")
                self._overruled_after |= bool(data.get("after"))
            case "order.completion" if data.get("refused") is None:
                self._flag = float(str(data["text"]))
            case "questionnaire.end":
                for name, asked in RATINGS.items():
                    if data["questionnaire"] == asked:
                        self._ratings[name] = _number(data.get(SHARE))

    def lines(self, newest: Mapping[str, float], settings: IndicatorSettings) -> list[str]:
        """Return what is known of the test, in words, a line each.

        Parameters
        ----------
        newest
            The newest frame, by column.
        settings
            Of the study.
        """
        running = self._row is None
        if not self._about or (running and not self._seen(newest)):
            return []
        time, counts = self._measured(newest)
        if not math.isfinite(time) or not all(map(math.isfinite, counts.values())):
            return []
        whole = {name: int(count) for name, count in counts.items()}
        times = self._references.get(_scene(self._about), {}).values()
        reference = sum(times) / len(times) if times else math.nan
        return [
            self._heading(running=running),
            _time(time, reference),
            *(f"{WORDS[name]}: {whole[name]} of {settings.mistakes}" for name in COUNTS),
            *(f"drops: {whole[name]}, outside the indicator" for name in whole.keys() - COUNTS),
            self._points(time, whole, reference, settings, running=running),
        ]

    def _seen(self, newest: Mapping[str, float]) -> bool:
        """Whether the newest frame is of this trial, and its task counts mistakes."""
        there = {"trial", "elapsed", *LIVE.values()} <= newest.keys()
        return there and newest["trial"] == _number(self._about["trial"])

    def _measured(self, newest: Mapping[str, float]) -> tuple[float, dict[str, float]]:
        if self._row is None:
            seen = LIVE | ({"drop": LIVE_DROPS} if LIVE_DROPS in newest else {})
            return newest["elapsed"], {name: newest[column] for name, column in seen.items()}
        row = self._row
        ended = COUNTS | ({"drop": DROPS} if DROPS in row else {})
        return _number(row[TIME]), {name: _number(row[column]) for name, column in ended.items()}

    def _heading(self, *, running: bool) -> str:
        about = self._about
        kind = "practice" if about.get("practice") else "test"
        kind = "reference" if about.get("reference") else kind
        scene = f" in {_scene(about)}" if _scene(about) else ""
        return f"{kind}{scene}, {'running' if running else 'ended'}"

    def _points(
        self,
        time: float,
        counts: Mapping[str, int],
        reference: float,
        settings: IndicatorSettings,
        *,
        running: bool,
    ) -> str:
        if self._about.get("practice") or self._about.get("reference"):
            return "no indicator: this is not a test"
        if not math.isfinite(reference):
            return "no indicator: this scenario has no reference time"
        # A running test is assumed to be completed in the end.
        outcome = "success" if self._row is None else str(self._row["outcome"])
        completed, why = completion(
            {"completion": self._flag, "outcome": outcome},
            max(counts[name] for name in COUNTS),
            settings,
            overruled=self._overruled,
            overruled_after=self._overruled_after,
        )
        ratings = {name: self._ratings.get(name, math.nan) for name in RATINGS}
        test = Performance(
            max(time, 1e-9),
            object=counts["object"],
            body=counts["body"],
            overload_max=counts["overload_max"],
            overload_min=counts["overload_min"],
            completed=completed,
            drop=counts.get("drop", 0),
            **ratings,
        )
        found = indicate(test, reference, settings)
        most = sum(most for name, most in found.largest.items() if name not in RATINGS)
        assumed = running and completed and math.isnan(self._flag)
        k = f"k {int(completed)} ({'if it is completed' if assumed else why})"
        if math.isnan(found.raw):
            points = completed * found.objective
            return f"indicator: {points:.1f} of {most:g}, ratings not yet given; {k}"
        return f"indicator: {found.raw:.1f}, {found.percent:.1f} %; {k}"


def _scene(about: Mapping[str, Value]) -> str:
    return str(about.get("scenario") or "")


def _time(time: float, reference: float) -> str:
    if not math.isfinite(reference):
        return f"time: {time:.1f} s, no reference yet"
    return f"time: {time:.1f} s, reference {reference:.1f} s: {100.0 * time / reference:.0f} %"


def _number(value: Value) -> float:
    return math.nan if value is None else float(str(value))
