"""The public names of this package, and the modules from which they are imported."""

from .replay import Difference, Replayed, replay_session

__all__ = ["Difference", "Replayed", "replay_session"]
