"""The participants: register, consent, deviations, erasure, relabelling, transfer, merge.

In come pseudonyms, never names; out go entries that outlive a crash, and proof of what was erased.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
