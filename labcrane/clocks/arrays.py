"""Correction of other clocks' timestamps on plain arrays, for any recording."""

from collections.abc import Collection
from typing import Literal

import numpy as np
import numpy.typing as npt

from labcrane.errors import RecordingError
from labcrane.streams.sync.correction import Corrected, Treatment
from labcrane.streams.sync.correction import correct as correct_raw
from labcrane.streams.sync.dejitter import Dejitter
from labcrane.streams.sync.raw import RawStream
from labcrane.streams.sync.sampling import Stamped

__all__ = ["Corrected", "correct"]

PROBE = ("remote time", "offset", "round trip")
EVENING = {"auto": Dejitter.AUTO, "forbid": Dejitter.NONE, "force": Dejitter.LEAST_SQUARES}


def correct(
    stamps: npt.ArrayLike,
    *,
    probes: npt.ArrayLike | None = None,
    arrivals: npt.ArrayLike | None = None,
    counter: npt.ArrayLike | None = None,
    rate_hz: float = 0.0,
    latency_s: float = 0.0,
    evening: Literal["auto", "forbid", "force"] = "auto",
    stamped: Literal["", "at_sampling", "when_sent"] = "",
    end: float | None = None,
) -> Corrected:
    """Map timestamps of another clock onto the receiver's, with the uncertainty of each.

    The offset ``o(t)`` of the receiver's clock from the source's is followed in the source's time
    ``t`` by a Kalman smoother with the state (offset, skew, share). Skew does a random walk, so
    that offset is its integral (Kalman 1960; Rauch, Tung and Striebel 1965; in the backward form of
    Bryson and Frazier). A probe measures ``o + share * excess + e``: *excess* is the difference of
    its round trip from the shortest of all, and *share* the part of that on one way,
    between -1/2 and 1/2 (the bound of NTP's clock filter, RFC 5905 section 10, and of its
    huff-n'-puff filter). How fast skew walks and how large ``e`` is are not assumed: a grid of
    models is weighed by likelihood, and averaged by it.

    If probes jump by more than round trips allow, a new clock begins there. Samples without probes
    are placed by their arrival, and marked so.

    Parameters
    ----------
    stamps
        As the source gave them, in the order of arrival, in seconds, shape ``(n,)``.
    probes
        Clock probes: source's time, the offset of the receiver's time from it, round trip, in
        seconds, shape ``(n_probes, 3)``; in LSL, the result of ``lsl_time_correction_ex``.
    arrivals
        When each sample came, on the receiver's clock, in seconds, shape ``(n,)``.
    counter
        The source's own number of each sample, without wraps, shape ``(n,)``: shows losses.
    rate_hz
        Nominal rate; 0 for irregular streams, such as markers.
    latency_s
        Stated delay of the device from sampling to stamping; subtracted.
    evening
        Whether timestamps of a regular stream are dejittered: only if they evidently scatter about
        a steady sample clock (``"auto"``), never, or always.
    stamped
        When samples of a regular stream get their timestamps, if that is known. At sampling: they
        are the samples' own times, a step to later is a pause, and what scatters are the samples.
        When sent: each is late by a wait that changes. Otherwise ``error`` includes what either
        leaves open.
    end
        When the recording ended, on the receiver's clock: shows that a source died before.

    Returns
    -------
    Corrected
        ``time`` and ``error`` (half width of a 95 % interval) of each sample in seconds,
        ``terms`` (what the error is the sum of, by name: clock, lag, stamps, losses, shifts),
        ``uneven`` (before dejittering), ``basis`` and a ``quality`` summary.

    Raises
    ------
    RecordingError
        An array has another shape, a value is not a number, or a rate or a round trip is
        negative.

    Notes
    -----
    Assumption that the data cannot show: the shortest round trip is split evenly. Half of it is
    part of ``error``. The delay in the device before the timestamp is not.

    Examples
    --------
    >>> import numpy as np
    >>> from labcrane.clocks import correct
    >>> clock = np.arange(0.0, 60.0, 0.01) * (1 + 50e-6) + 1000.0
    >>> at = np.arange(0.0, 60.0, 2.0)
    >>> there = at * (1 + 50e-6) + 1000.0
    >>> probes = np.column_stack([there, at - there, np.full(len(at), 2e-4)])
    >>> corrected = correct(clock, probes=probes, rate_hz=100.0)
    >>> bool(np.abs(corrected.time - np.arange(0.0, 60.0, 0.01)).max() < 1e-5)
    True
    """
    _chosen("evening", evening, EVENING)
    _chosen("stamped", stamped, [one.value for one in Stamped])
    if stamped == "at_sampling" and evening == "force":
        raise RecordingError("evening is 'force', but timestamps of samples' own times stay")
    _known("rate_hz", rate_hz, least=0.0)
    _known("latency_s", latency_s)
    if end is not None:
        _known("end", end)
    taken = _column("stamps", stamps)
    count = len(taken)
    shown = np.empty((0, 4))
    if probes is not None:
        table = np.asarray(probes, dtype=np.float64)
        if table.ndim != 2 or table.shape[1] != len(PROBE) or not np.isfinite(table).all():  # noqa: PLR2004
            raise RecordingError(
                f"probes must be finite numbers of the shape (n, 3), {', '.join(PROBE)}; they have "
                f"the shape {table.shape}"
            )
        if (table[:, 2] < 0.0).any():
            raise RecordingError(
                f"round trips, the third column of probes, are {table[:, 2].min():.6g} s at least; "
                "they must not be negative"
            )
        table = table[np.argsort(table[:, 0] + table[:, 1], kind="stable")]
        shown = np.column_stack([table, table[:, 0] + table[:, 1]])
    came = np.empty((0, 2))
    if arrivals is not None:
        when = _column("arrivals", arrivals, count)
        came = np.column_stack([np.arange(1.0, count + 1.0), when])
    index = None if counter is None else _column("counter", counter, count)
    treatment = Treatment(
        rate_hz=rate_hz,
        stamped=Stamped(stamped),
        latency_s=latency_s,
        dejitter=EVENING[evening],
    )
    return correct_raw(RawStream(taken, shown, came, index=index), treatment, end)


def _chosen(name: str, value: str, choices: Collection[str]) -> None:
    if value not in choices:
        raise RecordingError(f"{name} is {value!r}; it may be {', '.join(map(repr, choices))}")


def _known(name: str, value: float, least: float = -np.inf) -> None:
    if not np.isfinite(value) or value < least:
        wanted = "a finite number" if least < 0.0 else "a finite number and not negative"
        raise RecordingError(f"{name} is {value}; it must be {wanted}")


def _column(name: str, values: npt.ArrayLike, count: int | None = None) -> npt.NDArray[np.float64]:
    column = np.asarray(values, dtype=np.float64)
    if column.ndim != 1 or (count is not None and len(column) != count):
        wanted = "(n,)" if count is None else f"({count},), one per stamp"
        raise RecordingError(f"{name} must have the shape {wanted}, but have {column.shape}")
    if not np.isfinite(column).all():
        raise RecordingError(f"{name} contain values that are not numbers; leave those samples out")
    return column
