"""Plugins: found, imported, described, scaffolded and watched.

In come entry points and the folder ``plugins/`` next to a protocol; out go offers by role and name,
and proxies that name the plugin when a call fails, is late or does not return numbers.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
