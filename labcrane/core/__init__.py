"""The contract of a run: the records that flow through it, and the roles that a plugin fills.

In comes what a plugin makes of a role, an abstract class in ``roles``; out go plain records that
all other packages speak: ticks, frames, events, signals, primitives, questionnaire items.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
