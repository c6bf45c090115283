"""The public names of this package, and the modules from which they are imported."""

from .products import written_about

__all__ = ["written_about"]
