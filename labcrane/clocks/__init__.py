"""Correction of clocks as in ``streams.sync``, for plain arrays and any recorder's XDF file.

In come stamps of another clock, and what is known of it; out go times on the receiver's clock, and
how far each may be off.
"""

from labcrane.clocks.arrays import Corrected, correct

__all__ = ["Corrected", "correct"]
