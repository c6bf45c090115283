"""A recorded session run again, bit for bit.

In comes a participant file; out goes the same session, and the first number that differs, if any.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
