"""Smoother of a clock's offset and skew: a Kalman filter run forwards and backwards.

State: offset, skew (its rate of change), and the share of a probe's excess round trip that lies on
one way. Skew does a random walk, so that a crystal's wander is followed as closely as the probes
tell and no closer; how fast it walks and how probes scatter are weighed by likelihood over a grid
of models, and their curves averaged by it (Hoeting et al. 1999, Bayesian model averaging).
The backward pass is the one of Bryson and Frazier (Bierman 1977), which inverts no matrix.

Inside, offsets are in microseconds and skews in parts per million.
"""

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from labcrane.streams.sync.clock_curve import Smoothed
from labcrane.types import FloatArray

MICRO = 1e6

WALKS = tuple(10.0 ** np.arange(-6.0, 7.0))
"""Variance by which skew walks in a second, in ppm squared."""

USUAL_WALK = 1e-3
WALK_DECADES = 2.0

SCATTERS = (2.0, 10.0, 50.0, 250.0, 1250.0)
"""Standard deviation of probes beside what their round trips explain, in microseconds."""

SHARES = ((0.3, 1e2), (0.3, 1e4), (0.03, 1e2), (0.03, 1e4), (0.03, 1e6), (0.003, 1e4), (0.003, 1e6))
"""How an excess round trip is shared by its ways: by how much the share differs from probe to probe
(half would be all of it), and for how many seconds it else stays as it is. A congestion passes, a
route does not."""

LASTING_SHARE = 0.3
"""How much of an excess round trip lies on one way for as long as that lasts."""

USUAL_SPREAD_PPM = 300.0
FIRST_US = 2e4
TAIL = 4.0
"""Degrees of freedom of the innovations' likelihood: single strays must not decide."""

TURN = 4.0
"""A turn anywhere between two probes deviates by up to a quarter of it, not by a walk's 0.14."""

KNEE = 8.0
"""How many times beyond its usual a change of slope is a knee, at which skew may change freely."""

LEVELS_US = (30.0, 300.0, 3000.0, np.inf)
"""Excess of round trips up to which slopes are looked at, in microseconds."""

NEGLIGIBLE = 1e-3


@dataclass(frozen=True, slots=True)
class _Models:
    """The grid's models, shape ``(n_models,)`` each, in microseconds."""

    walk: FloatArray
    scatter: FloatArray
    share: FloatArray
    lasting: FloatArray

    def some(self, chosen: npt.NDArray[np.intp]) -> "_Models":
        return _Models(
            self.walk[chosen], self.scatter[chosen], self.share[chosen], self.lasting[chosen]
        )


@dataclass(frozen=True, slots=True)
class _Series:
    """Measurements, in seconds and microseconds, shape ``(n,)`` each."""

    step: FloatArray
    offset: FloatArray
    excess: FloatArray
    knee: FloatArray
    slope: float


@dataclass(frozen=True, slots=True)
class _Pass:
    """What the forward pass leaves to the backward one, first axis the measurements."""

    state: FloatArray
    covariance: FloatArray
    gain: FloatArray
    surprise: FloatArray
    expected: FloatArray


def smooth(
    time: FloatArray,
    offset: FloatArray,
    excess: FloatArray,
    usual_slope: float = 0.0,
    *,
    scatter_s: tuple[float, ...] | None = None,
    usual_walk: float = USUAL_WALK,
) -> Smoothed:
    """Follow a clock's offset by its measurements.

    Parameters
    ----------
    time
        Of the clock, ascending, in seconds, shape ``(n,)``, at least one.
    offset
        Measured there, in seconds, shape ``(n,)``.
    excess
        By how much each round trip was longer than the shortest, in seconds, shape ``(n,)``: the
        measurement errs by half of it at most.
    usual_slope
        What is expected of the skew before anything was measured.
    scatter_s
        Standard deviations of measurements between which likelihood decides; None for the ones of
        clock probes.
    usual_walk
        Variance by which skew is expected to walk in a second, in ppm squared, within decades.
    """
    first = float(offset[0])
    series = _Series(
        np.diff(time, prepend=time[:1]),
        MICRO * (offset - first),
        MICRO * np.maximum(excess, 0.0),
        np.zeros(len(time)),
        MICRO * usual_slope,
    )
    series = _with_knees(series)
    scatters = SCATTERS if scatter_s is None else tuple(MICRO * s for s in scatter_s)
    shares = SHARES if excess.any() else ((0.0, 1.0),)
    grid = [(walk, s, *share) for walk, s, share in itertools.product(WALKS, scatters, shares)]
    models = _Models(*np.array(grid).T)
    likelihood, _ = _forwards(series, models, keep=False)
    odds = likelihood - 0.5 * (np.log10(models.walk / usual_walk) / WALK_DECADES) ** 2
    weight = np.exp(odds - odds.max())
    chosen = np.flatnonzero(weight > NEGLIGIBLE)
    models, weight = models.some(chosen), weight[chosen] / weight[chosen].sum()
    _, passed = _forwards(series, models, keep=True)
    mean, covariance = _averaged(*_backwards(series, passed, models.lasting), weight)
    walk = float(weight @ models.walk) + series.knee[1:]
    return Smoothed(
        time,
        first + mean[:, 0] / MICRO,
        mean[:, 1] / MICRO,
        covariance / MICRO**2,
        walk / MICRO**2,
    )


def _with_knees(series: _Series) -> _Series:
    """Let skew change freely where neighbouring slopes differ as they do nowhere else.

    A clock that is slewed turns at once from one rate to another. A walk fast enough for that
    would be too fast for all the rest. Where probes are held up, neighbours tell nothing of a
    slope: it is looked for between those that were held up little, at each of some levels, and
    skew is free wherever in between the clock may have turned.
    """
    knee = np.zeros(len(series.offset))
    time = np.cumsum(series.step)
    seen = -1
    for level in LEVELS_US:
        clear = np.flatnonzero(series.excess <= level)
        if len(clear) < 8 or len(clear) == seen:  # noqa: PLR2004
            continue
        seen = len(clear)
        found = _knees(time[clear], series.offset[clear], series.excess[clear])
        knee = np.maximum(knee, np.pad(found, (0, 1))[np.searchsorted(clear, np.arange(len(knee)))])
    return _Series(series.step, series.offset, series.excess, knee, series.slope)


def _knees(time: FloatArray, offset: FloatArray, excess: FloatArray) -> FloatArray:
    """Return how freely skew may walk before each measurement, for knees that these show."""
    step = np.maximum(np.diff(time), 1e-3)
    slope = np.diff(offset) / step
    noise = 5.0**2 + (0.5 * excess) ** 2
    doubt = (noise[1:] + noise[:-1]) / step**2
    turn, doubt = np.diff(slope), np.sqrt(doubt[1:] + doubt[:-1])
    usual = max(1.4826 * float(np.median(np.abs(turn) / doubt)), 1.0)
    clear = np.abs(turn) > KNEE * usual * doubt
    free = np.where(clear, TURN * turn**2, 0.0)
    knee = np.zeros(len(offset))
    knee[1:-1] = free / step[:-1]
    knee[2:] = np.maximum(knee[2:], free / step[1:])
    return knee


def _forwards(series: _Series, models: _Models, *, keep: bool) -> tuple[FloatArray, _Pass]:
    """Filter; return each model's log likelihood, and what the way back needs."""
    count, n = len(models.walk), len(series.offset) if keep else 0
    kept = _Pass(
        np.empty((n, count, 3)), np.empty((n, count, 3, 3)), np.empty((n, count, 3)),
        np.empty((n, count)), np.empty((n, count)),
    )  # fmt: skip
    x = np.zeros((count, 3))
    x[:, 1] = series.slope
    p = np.tile(np.diag([FIRST_US**2, USUAL_SPREAD_PPM**2, LASTING_SHARE**2]), (count, 1, 1))
    likelihood = np.zeros(count)
    for k, (step, measured, excess, knee) in enumerate(
        zip(series.step, series.offset, series.excess, series.knee, strict=True)
    ):
        if k:
            _predict(x, p, step, models.walk + knee, models.lasting)
        hx = p[:, :, 0] + excess * p[:, :, 2]
        expected = hx[:, 0] + excess * hx[:, 2] + models.scatter**2 + (models.share * excess) ** 2
        surprise = measured - x[:, 0] - excess * x[:, 2]
        gain = hx / expected[:, None]
        if keep:
            kept.state[k], kept.covariance[k], kept.gain[k] = x, p, gain
            kept.surprise[k], kept.expected[k] = surprise, expected
        if k > 1:
            tail = np.log1p(surprise**2 / (TAIL * expected))
            likelihood -= 0.5 * np.log(expected) + 0.5 * (TAIL + 1.0) * tail
        x = x + gain * surprise[:, None]
        p = p - gain[:, :, None] * hx[:, None, :]
    return likelihood, kept


def _predict(
    x: FloatArray, p: FloatArray, step: float, walk: FloatArray, lasting: FloatArray
) -> None:
    """Let time pass, in place."""
    stays = np.exp(-step / lasting)
    x[:, 0] += step * x[:, 1]
    x[:, 2] *= stays
    p[:, 0, :] += step * p[:, 1, :]
    p[:, :, 0] += step * p[:, :, 1]
    p[:, 2, :] *= stays[:, None]
    p[:, :, 2] *= stays[:, None]
    p[:, 2, 2] += LASTING_SHARE**2 * (1.0 - stays**2)
    p[:, 0, 0] += walk * step**3 / 3.0
    p[:, 0, 1] += walk * step**2 / 2.0
    p[:, 1, 0] += walk * step**2 / 2.0
    p[:, 1, 1] += walk * step


def _backwards(series: _Series, kept: _Pass, lasting: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return smoothed offset and skew ``(n, models, 2)``, and their covariance ``(.., 3)``."""
    n, count = kept.surprise.shape
    mean, covariance = np.empty((n, count, 2)), np.empty((n, count, 3))
    pull, hold = np.zeros((count, 3)), np.zeros((count, 3, 3))
    move = np.tile(np.eye(3), (count, 1, 1))
    for k in range(n - 1, -1, -1):
        h = np.array([1.0, 0.0, series.excess[k]])
        through = np.eye(3) - kept.gain[k][:, :, None] * h
        back = through.transpose(0, 2, 1)
        pull = (back @ pull[:, :, None])[:, :, 0]
        pull = pull - h * (kept.surprise[k] / kept.expected[k])[:, None]
        hold = back @ hold @ through + np.outer(h, h) / kept.expected[k][:, None, None]
        p = kept.covariance[k]
        mean[k] = (kept.state[k] - (p @ pull[:, :, None])[:, :, 0])[:, :2]
        smoothed = p - p @ hold @ p
        covariance[k] = smoothed[:, [0, 0, 1], [0, 1, 1]]
        move[:, 0, 1] = series.step[k]
        move[:, 2, 2] = np.exp(-series.step[k] / lasting)
        pull = (pull[:, None, :] @ move)[:, 0, :]
        hold = move.transpose(0, 2, 1) @ hold @ move
    return mean, covariance


def _averaged(
    mean: FloatArray, covariance: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance over the models: they may disagree, which is doubt as well."""
    whole = np.einsum("nmi,m->ni", mean, weight)
    apart = mean - whole[:, None, :]
    spread = np.stack(
        [apart[..., 0] ** 2, apart[..., 0] * apart[..., 1], apart[..., 1] ** 2], axis=-1
    )
    return whole, np.einsum(
        "nmi,m->ni", np.maximum(covariance, [0.0, -np.inf, 0.0]) + spread, weight
    )
