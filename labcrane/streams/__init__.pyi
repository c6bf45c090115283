"""The public names of this package, and the modules from which they are imported."""

from .newest import NewestSample

__all__ = ["NewestSample"]
