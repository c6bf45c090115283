"""labcrane: studies of people operating cranes and manipulators.

Everything a plugin needs is importable from here, and nothing else is public, except the contract
tests in ``labcrane.testing``.

The names are listed in ``__init__.pyi``. One is imported from its module when it is asked for the
first time, so that ``labcrane --help`` loads none of them.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
