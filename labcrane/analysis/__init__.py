"""Results: cohort, movements, measures and the performance indicator.

In come participant files; out go tables with one row per movement, and what they say. Nothing here
is needed while people are recorded; what is heavy is imported when it is used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
