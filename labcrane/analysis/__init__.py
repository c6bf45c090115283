"""Results: cohort, movements, measures and the performance indicator.

Input: participant files. Output: tables with one row per movement, and their statistics. Nothing
here is needed while people are recorded; large libraries are imported when they are used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
