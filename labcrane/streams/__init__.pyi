"""The public names of this package, and the modules from which they are imported."""

from .newest import NewestSample, numeric_labels

__all__ = ["NewestSample", "numeric_labels"]
