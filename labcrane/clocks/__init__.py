"""The correction of clocks for any recording, as a function of plain arrays.

In come stamps and clock probes; out go corrected times, and how right each of them is.
"""

from labcrane.clocks.arrays import Corrected, correct

__all__ = ["Corrected", "correct"]
