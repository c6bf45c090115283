"""Quality of a picture: what is drawn of shadows and edges, and how long that may take."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import Literal

LONGEST_S = 0.025
"""A picture that takes longer is drawn with less: 40 a second leave time for the rest."""

WARM, MEASURED = 4, 9
"""Pictures before it is measured, while textures and shadows are made, and those that are."""

Level = Literal["low", "medium", "high"]


@dataclass(frozen=True, slots=True)
class RenderQuality:
    """What is drawn.

    Attributes
    ----------
    shadow
        Edge of the shadow maps in pixels; 0 for none.
    soft
        Whether the edges of shadows are smoothed.
    samples
        Samples a pixel, for smooth edges; 0 for one.
    """

    shadow: int
    soft: bool
    samples: int


LEVELS: Mapping[Level, RenderQuality] = {
    "high": RenderQuality(shadow=2048, soft=True, samples=4),
    "medium": RenderQuality(shadow=1024, soft=False, samples=0),
    "low": RenderQuality(shadow=0, soft=False, samples=0),
}


def intervals_s(
    draw: Callable[[], None], warm: int, count: int, now: Callable[[], float]
) -> list[float]:
    """Draw pictures; return how long each of the last ``count`` took, in seconds."""
    for _ in range(warm):
        draw()
    moments = [now()]
    for _ in range(count):
        draw()
        moments.append(now())
    return [after - before for before, after in pairwise(moments)]


def picture_s(draw: Callable[[], None], now: Callable[[], float] = time.perf_counter) -> float:
    """Return how long a picture takes, in seconds: the median of some."""
    return median(intervals_s(draw, WARM, MEASURED, now))


def chosen(measure: Callable[[Level], float]) -> tuple[Level, str]:
    """Return the best quality that is quick enough, and why, in words.

    ``measure`` opens a picture of a quality and says how long one takes, in seconds.
    """
    said: list[str] = []
    for level in LEVELS:
        took = measure(level)
        said.append(f"{level} took {1000.0 * took:.1f} ms a picture")
        if took <= LONGEST_S:
            break
    return level, f"{level} (auto: {', '.join(said)})"
