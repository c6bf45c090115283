"""labcrane: studies of people operating cranes and manipulators.

What every plugin needs is importable from here: roles, what flows through a run, settings, offers,
errors. The rest of what is public is in ``core`` (records, items, shapes), ``machines``,
``recording``, ``analysis``, ``replay``, ``registry`` (commands, what is not installed),
``participants``, ``streams`` (the newest sample of a stream) and ``testing`` (contract tests), each
with ``__all__``. Nothing else is public.

The names are listed in ``__init__.pyi``. One is imported from its module when it is asked for the
first time, so that ``labcrane --help`` loads none of them.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
