"""Machines that are operated, and their surroundings.

In comes a machine or scene file; out go links with their masses and limits, forward and inverse
kinematics, URDF, meshes and placed objects. Nothing here knows of a session.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
