"""The correction of clocks for any recording, as a function of plain arrays."""

from labcrane.clocks.arrays import Corrected, correct

__all__ = ["Corrected", "correct"]
