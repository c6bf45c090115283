"""Rows of every benchmark: a figure, a bare reference from the same run, and a limit."""

import json
import math
from collections.abc import Iterable
from dataclasses import astuple, dataclass


@dataclass(frozen=True)
class Row:
    """One figure and its limit.

    Attributes
    ----------
    subject, what
        Which benchmark, and what was measured, with its unit.
    ours, bare
        labcrane's figure and the reference's.
    reference
        What the reference is.
    limit
        Maximum of the ratio. A figure without a limit is not a row.

    Raises
    ------
    ValueError
        No ratio could exceed the limit.
    """

    subject: str
    what: str
    ours: float
    bare: float
    reference: str
    limit: float

    def __post_init__(self) -> None:
        if not 0.0 < self.limit < math.inf:
            raise ValueError(f"{self.subject}: {self.what}: {self.limit} cannot limit a ratio")

    @property
    def ratio(self) -> float:
        """Ours over bare."""
        return self.ours / self.bare

    @property
    def kept(self) -> bool:
        """Whether the ratio is within its limit; NaN is not."""
        return self.ratio <= self.limit


def missed(rows: Iterable[Row]) -> list[str]:
    """Return a line for each row whose ratio is above its limit."""
    return [
        f"{row.subject}: {row.what} is {row.ours:.3g}, {row.ratio:.3g} times {row.reference} "
        f"({row.bare:.3g}); at most {row.limit:g} times is promised"
        for row in rows
        if not row.kept
    ]


def show(rows: Iterable[Row]) -> None:
    """Print rows for people."""
    for row in rows:
        print(
            f"{row.subject:10} {row.what}: {row.ours:.3g}; {row.reference}: {row.bare:.3g}; "
            f"ratio {row.ratio:.3g} (at most {row.limit:g}){'' if row.kept else '  MISSED'}"
        )


def dumped(rows: Iterable[Row]) -> str:
    """Return rows as one line, for the calling process."""
    return json.dumps([astuple(row) for row in rows])


def loaded(line: str) -> list[Row]:
    """Return the rows of :func:`dumped`."""
    return [Row(*fields) for fields in json.loads(line)]
