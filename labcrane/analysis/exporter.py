"""The role of an exporter: it works on what was recorded, long after the session."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.core.roles import Component

if TYPE_CHECKING:
    from labcrane.analysis.cohort import Participant


class Exporter(Component):
    """What turns recordings into files for other programs.

    Built with the machine that was operated; ``open``, ``begin_trial`` and ``close`` are never
    called.
    """

    @abstractmethod
    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        """Write the data of ``participants`` into ``folder``, which exists and is empty.

        Go through the participants once and keep nothing of one while the next is read: there may
        be hundreds. Every table says the status of each participant; the caller writes down who
        was left out.
        """
