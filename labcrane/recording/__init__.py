"""The journal of a session: frames and events, written through while people are recorded.

In come frames, events and the streams of other programs; out go XDF journals that a killed process
leaves readable. ``participant_file`` makes one HDF5 file of them afterwards.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
