"""Practice: when its criterion is met."""

from labcrane.core.records import UNDONE, Phase, Value
from labcrane.design.plan import PlannedBlock


class WarmUp:
    """Counts successes in a row over the rounds of a practice block.

    Attributes
    ----------
    over
        Whether no more of the practice is needed.
    streak
        Number of successes in a row.
    """

    def __init__(self) -> None:
        self.over = False
        self.streak = 0
        self._number = 0

    def begin(self, block: PlannedBlock) -> bool:
        """Return whether to run ``block``; further rounds are not, once practice is over."""
        if block.until is None or self._number == 0:
            self.streak = block.streak  # of before the session stopped; it counts on
            self.over = block.until is not None and self.streak >= block.until.successes
        self._number = 0 if block.until is None else self._number + 1
        wanted = not self.over
        if block.last:
            self._number = 0
        return wanted

    def count(self, block: PlannedBlock, outcome: Phase) -> None:
        """Count a trial."""
        if block.until is not None and outcome not in UNDONE:
            self.streak = self.streak + 1 if outcome is Phase.SUCCESS else 0
            self.over = self.over or self.streak >= block.until.successes

    def verdict(self, block: PlannedBlock) -> dict[str, Value] | None:
        """Return what to record at the end of ``block``; None while practice goes on."""
        if block.until is None or not (self.over or block.last):
            return None
        return {"met": self.over, "in_a_row": self.streak, "wanted": block.until.successes}
