"""Table of figures, each beside a bare reference in the same run."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One figure.

    Attributes
    ----------
    subject, what
        Which benchmark, and what was measured, with its unit.
    ours, bare
        labcrane's figure and the reference's.
    reference
        What the reference is.
    goal
        What the ratio should be at most; None where there is no goal.
    """

    subject: str
    what: str
    ours: float
    bare: float
    reference: str
    goal: float | None = None

    @property
    def ratio(self) -> float:
        """Ours over bare."""
        return self.ours / self.bare


def show(rows: list[Row]) -> None:
    """Print rows for people."""
    for row in rows:
        goal = "" if row.goal is None else f" (at most {row.goal:g})"
        print(
            f"{row.subject:10} {row.what}: {row.ours:.3g}; {row.reference}: {row.bare:.3g}; "
            f"ratio {row.ratio:.2f}{goal}"
        )
