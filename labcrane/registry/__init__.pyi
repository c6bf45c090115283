"""The public names of this package, and the modules from which they are imported."""

from .offers import LAB, CommandOffer, Prompt, not_installed
from .quiet_import import quietly_imported

__all__ = [
    "LAB",
    "CommandOffer",
    "Prompt",
    "not_installed",
    "quietly_imported",
]
