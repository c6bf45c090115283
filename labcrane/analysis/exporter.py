"""The role of an exporter: it works on recordings, long after the session."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from labcrane.core.roles import Component

if TYPE_CHECKING:
    from labcrane.analysis.cohort import Participant


class Exporter(Component):
    """Converts recordings into files for other programs.

    Built with the machine that was operated; ``open``, ``begin_trial`` and ``close`` are never
    called.
    """

    shared: ClassVar[tuple[str, ...]] = ()
    """Patterns of files without any participant's data, as ``read.R``: they stay when one is
    erased. Every other file that may hold a participant's data is edited then, or removed."""

    @abstractmethod
    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        """Write the data of ``participants`` into ``folder``, which exists and is empty.

        All files in it at the end are entered into the register, with their participants: a file
        that is named after one participant, and written while that participant is the last that
        was read, belongs to that one alone. Its files move to their place afterwards.

        Go through the participants once and keep no data of one while the next is read: there may
        be hundreds. Every table states the status of each participant; the caller records who was
        left out.
        """
