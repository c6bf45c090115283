"""Tracks: the next level, from the participant's responses alone.

A track keeps no state of its own. Its next level is computed from the responses in the record,
by the same function in a session, after a kill, in the next session, and in a replay.

QUEST+ is our own: the library is unmaintained and too slow for a tick, and tests compare every
choice with it.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from labcrane.core.records import PlannedTrial, Trial, Value
from labcrane.design.quest_plus import grid
from labcrane.design.up_down import climb
from labcrane.errors import ProtocolError
from labcrane.protocol.tracks import Track

TRACK, LEVEL, SUCCESS = "track", "track_level", "track_success"
"""Columns of the trial table: the track, the level that it chose, and the success."""


@dataclass(frozen=True, slots=True)
class Response:
    """Response of a trial for a track.

    Attributes
    ----------
    success
        None without information, as for an approach movement or a skipped trial.
    """

    track: str
    level: str
    success: bool | None

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> "Response | None":
        """Return the response of a row of the trial table; None without a track."""
        if TRACK not in row:
            return None
        success = row.get(SUCCESS)
        return cls(str(row[TRACK]), str(row[LEVEL]), None if success is None else bool(success))


@dataclass(frozen=True, slots=True)
class TrackState:
    """State of a track.

    Attributes
    ----------
    level
        The next level; None at the end of the block.
    estimate, sd
        The threshold and its standard deviation, of a staircase that of its levels at reversals; in
        the levels' unit, NaN where it is not known yet.
    responses
        Number of responses, including earlier ones.
    """

    level: str | None
    estimate: float
    sd: float
    responses: int

    @property
    def row(self) -> dict[str, Value]:
        """Its values for the record."""
        known = self.estimate == self.estimate
        return {
            "estimate": self.estimate if known else None,
            "sd": self.sd if known else None,
            "responses": self.responses,
            "ended": self.level is None,
        }


def standing(
    track: Track, before: Sequence[tuple[str, bool]] = (), own: Sequence[tuple[str, bool]] = ()
) -> TrackState:
    """Return the state of a track.

    Parameters
    ----------
    before, own
        Levels and successes before the block, and in it.
    """
    responses = [*before, *own]
    if track.up_down is not None:
        stairs = climb(track.up_down, track.levels, track.start, responses, len(before))
        level = None if len(stairs.turns) >= track.up_down.reversals else stairs.level
        return TrackState(level, *stairs.estimate(track.up_down), len(responses))
    settings, names = track.quest_plus, tuple(track.levels)
    if settings is None:
        raise AssertionError("a track without a law is refused when it is read")
    counts = np.zeros((2, len(names)))
    for name, success in responses:
        counts[int(success), names.index(name)] += 1.0
    known = grid(settings, tuple(track.levels.values())).posterior(counts[1], counts[0])
    if settings.until_sd is not None and known.sd <= settings.until_sd:
        return TrackState(None, known.mean, known.sd, len(responses))
    first = track.start if not responses else ""
    return TrackState(first or names[known.best], known.mean, known.sd, len(responses))


@dataclass(frozen=True, slots=True)
class PlannedTrack:
    """A block's track: each of its trials at each level.

    Attributes
    ----------
    first, count
        Number of the block's first trial, and the maximum number of trials.
    rounds
        The trials of a round at each level; every level has as many.
    """

    name: str
    settings: Track
    first: int
    count: int
    rounds: Mapping[str, tuple[PlannedTrial, ...]]

    def __post_init__(self) -> None:
        # A grid and a process's first product of matrices take longer than a tick: both come now.
        standing(self.settings)

    @property
    def size(self) -> int:
        """Trials of a round."""
        return len(next(iter(self.rounds.values())))

    @property
    def longest_s(self) -> float:
        """Expected duration of a round at the longest level, in seconds."""
        return max(sum(each.expected_s for each in trials) for trials in self.rounds.values())

    @property
    def counted(self) -> int:
        """Counted trials of a round, which are responses for the track."""
        return sum(trial.counted for trial in next(iter(self.rounds.values())))

    @property
    def described(self) -> dict[str, Any]:
        """Its description in a recording: the law and the number of counted trials in a round."""
        return {"settings": self.settings.model_dump(mode="json"), "counted": self.counted}

    def at(self, number: int, level: str) -> PlannedTrial | None:
        """Return the trial of this number at a level; None if there is none."""
        trials = self.rounds.get(level)
        return None if trials is None else trials[(number - self.first) % self.size]

    def stands(
        self, so_far: Mapping[int, Response], carried: Iterable[Response] = ()
    ) -> TrackState:
        """Return its state.

        Parameters
        ----------
        so_far
            Responses of the session's trials, by their numbers, in the order in which they ended.
        carried
            Responses of trials in earlier sessions.
        """
        own = range(self.first, self.first + self.count)
        earlier = [*carried, *(each for number, each in so_far.items() if number not in own)]
        return standing(
            self.settings,
            self._of_this(earlier),
            self._of_this(each for number, each in so_far.items() if number in own),
        )

    def _of_this(self, responses: Iterable[Response]) -> list[tuple[str, bool]]:
        return [
            (each.level, each.success)
            for each in responses
            if each.track == self.name and each.success is not None
        ]

    def choose(
        self, trial: Trial, so_far: Mapping[int, Response], carried: Iterable[Response] = ()
    ) -> Trial | None:
        """Return a trial at the track's present level; None when the track has ended.

        A round that is under way keeps its level.
        """
        begins = trial.number - (trial.number - self.first) % self.size
        begun = [so_far[each] for each in range(begins, begins + self.size) if each in so_far]
        level = begun[0].level if begun else self.stands(so_far, carried).level
        planned = None if level is None else self.at(trial.number, level)
        return None if planned is None else replace(trial, planned=planned)


def plan_rounds(name: str, level: str, trials: Iterable[PlannedTrial]) -> tuple[PlannedTrial, ...]:
    """Return the trials of a round, with columns that name their track."""
    return tuple(
        replace(each, condition={**each.condition, TRACK: name, LEVEL: level}) for each in trials
    )


def check_carried(tracks: Mapping[str, Track], carried: Iterable[Response]) -> None:
    """Make sure that a participant's responses are at levels that their tracks have.

    Raises
    ------
    ProtocolError
        A track has lost a level since.
    """
    for each in carried:
        if each.track in tracks and each.level not in tracks[each.track].levels:
            raise ProtocolError(
                f"track {each.track!r} continues from an earlier session, which had its level "
                f"{each.level!r}, and it has {', '.join(tracks[each.track].levels)}; give it back, "
                "or start again with carry: false"
            )
