"""The public names of this package, and the modules from which they are imported."""

from .personal_data import personal_in
from .products import written_about

__all__ = ["personal_in", "written_about"]
