"""Eyes: which channels of a gaze stream belong to which eye, and which of its samples are gaze."""

import re
from collections.abc import Container, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from labcrane.types import FloatArray

CONFIDENCE = 0.3
"""Confidence, 0 to 1, below which a sample does not count as gaze, where a protocol has no other
one."""

LEFT, RIGHT, BOTH = "left", "right", ""
SIDES = {"left": LEFT, "l": LEFT, "right": RIGHT, "r": RIGHT}

SHARES = frozenset({"normalized", "normalised", "norm", "1", "ratio"})
"""Units of a place as a share of a picture."""

LOST_AT = (0.0, -1.0, -32768.0, 1e8)
"""Places, x and y alike, that trackers write where they have none; an EyeLink writes the last two
(``MISSING_DATA``)."""

_JOINED = re.compile("(left|right|gaze|screen|direction|por|pos|eye|pupil)")


class DescribedChannel(Protocol):
    """A channel as a stream's header states it."""

    @property
    def label(self) -> str:
        """What it is called."""

    @property
    def unit(self) -> str:
        """Its unit; may be empty."""

    @property
    def type(self) -> str:
        """What it measures; may be empty."""


@dataclass(frozen=True, slots=True)
class Eye:
    """The channels of one eye, or of both eyes together; each is a column of the stream.

    Attributes
    ----------
    side
        ``"left"``, ``"right"``, or empty for both, and where none is stated.
    x, y
        Where it looks.
    share
        Whether that is a share of a picture.
    pupil
        Size of its pupil; None without one.
    confidence
        How sure the tracker is, 0 to 1.
    """

    side: str
    x: int
    y: int
    share: bool
    pupil: int | None
    confidence: tuple[int, ...]

    def seen(self, samples: FloatArray, least: float) -> npt.NDArray[np.bool_]:
        """Return which samples are gaze, shape ``(n,)``.

        Parameters
        ----------
        samples
            Of all channels of the stream, shape ``(n, n_channels)``.
        least
            Confidence below which a sample is not gaze.
        """
        x, y = samples[:, self.x], samples[:, self.y]
        seen = is_sure(samples[:, list(self.confidence)], least)
        seen[~np.isfinite(x) | ~np.isfinite(y)] = False
        seen[(x == y) & np.isin(x, LOST_AT)] = False
        if self.share:  # far off the picture, but not in another unit
            seen[(np.abs(x - 0.5) > 1.5) & (np.abs(x) < 5.0)] = False  # noqa: PLR2004
        return seen


def is_sure(confidence: FloatArray, least: float) -> npt.NDArray[np.bool_]:
    """Return which samples of confidence, shape ``(n, n_channels)``, are enough in all channels."""
    return np.asarray(np.all(confidence >= least, axis=1))


def eyes_of(
    channels: Sequence[DescribedChannel], units: Container[str] | None = None
) -> tuple[Eye, ...]:
    """Return the eyes whose place a stream has: by side the first x with its y.

    Parameters
    ----------
    channels
        Of the stream, in the order of its columns.
    units
        Units of x, in lower case, that are wanted; all by default.
    """
    found: dict[str, Eye] = {}
    words = [_words(channel.label) for channel in channels]
    places = {said: column for column, said in reversed(list(enumerate(words)))}
    kinds = ["".join(_words(channel.type)) for channel in channels]
    sides = [side_of(channel) for channel in channels]
    for x, (said, kind, side) in enumerate(zip(words, kinds, sides, strict=True)):
        unit = channels[x].unit.strip().lower()
        if (
            {"pupil", "per"} & set(said)
            or kind.startswith("pupil")
            or (units is not None and unit not in units)
        ):
            continue
        y = None
        if "x" in said:
            y = places.get(tuple("y" if word == "x" else word for word in said))
        if y is None and kind in {"screenx", "directionx", "gazex"}:
            other = (f"{kind[:-1]}y", side)
            y = next((at for at in range(len(kinds)) if (kinds[at], sides[at]) == other), None)
        if y is not None and side not in found:
            pupils = [
                at for at, each in enumerate(channels) if is_pupil(each) and sides[at] == side
            ]
            confidence = tuple(
                at for at, each in enumerate(channels)
                if is_confidence(each) and sides[at] in (side, BOTH)
            )  # fmt: skip
            pupil = pupils[0] if pupils else None
            found[side] = Eye(side, x, y, unit in SHARES, pupil, confidence)
    return tuple(found.values())


def side_of(channel: DescribedChannel) -> str:
    """Return the side that a channel's label or type states; empty for none."""
    said = (*_words(channel.label), *_words(channel.type))
    return next((SIDES[word] for word in said if word in SIDES), BOTH)


def is_pupil(channel: DescribedChannel) -> bool:
    """Whether a channel is a pupil's size; its place in the camera's picture is not."""
    said = _words(channel.label)
    joined = "".join(said) + " " + "".join(_words(channel.type))
    alone = [word for word in said if word not in SIDES]
    return "diameter" in joined or "pupilsize" in joined or alone in (["pupil"], ["pupil", "area"])


def is_confidence(channel: DescribedChannel) -> bool:
    """Whether a channel says how sure the tracker is."""
    return "confidence" in "".join(_words(channel.label) + _words(channel.type))


def _words(text: str) -> tuple[str, ...]:
    """Return the words and numbers of a label in lower case: ``leftGazeX``, ``left_gaze_x``."""
    apart = re.sub("([a-z])([A-Z])", r"\1 \2", text).lower()
    return tuple(re.findall("[a-z]+|[0-9]+", _JOINED.sub(r" \1 ", apart)))
