"""The crane as URDF text, without shapes: it has nothing to touch."""

from labcrane import urdf

__all__ = ["urdf"]
