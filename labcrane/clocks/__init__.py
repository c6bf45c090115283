"""Correction of clocks as in ``streams.sync``, for plain arrays and any recorder's XDF file.

Input: timestamps of another clock, and its clock probes. Output: times on the receiver's clock,
with their uncertainty.
"""

from labcrane.clocks.arrays import Corrected, correct

__all__ = ["Corrected", "correct"]
