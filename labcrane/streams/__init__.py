"""LSL: what a session sends, and how the streams of others are found.

In come frames, events and pictures; out go outlets, and inlets that connect again. pylsl is
imported when it is used: liblsl reads its configuration when it is loaded.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
