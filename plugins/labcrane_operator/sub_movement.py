"""One planned stroke of the tip, as smooth as can be."""

import math

Point = tuple[float, float, float]


class SubMovement:
    """The straight movement of least jerk between two points (Flash and Hogan 1985).

    Parameters
    ----------
    start, end
        Tip positions in the base frame, in m.
    duration
        In seconds.

    Attributes
    ----------
    way
        From start to end, in m.
    """

    def __init__(self, start: Point, end: Point, duration: float) -> None:
        self.end = end
        self.duration = duration
        self.start = start
        self.way = (end[0] - start[0], end[1] - start[1], end[2] - start[2])

    def at(self, time: float) -> tuple[Point, Point]:
        """Return position in m and velocity in m/s, ``time`` seconds after the start."""
        u = time / self.duration
        if u >= 1.0:
            return self.end, (0.0, 0.0, 0.0)
        share = u * u * u * (10.0 + u * (6.0 * u - 15.0))
        rest = 1.0 - u
        pace = 30.0 * u * u * rest * rest / self.duration
        (x, y, z), (dx, dy, dz) = self.start, self.way
        return (
            (x + share * dx, y + share * dy, z + share * dz),
            (pace * dx, pace * dy, pace * dz),
        )


def fitts_duration(a: float, b: float, distance: float, width: float) -> float:
    """Return ``a + b log2(distance / width + 1)`` in seconds, lengths in m."""
    return a + b * math.log2(distance / width + 1.0)
