"""The role of an exporter: it works on what was recorded, long after the session."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from labcrane.core.roles import Component

if TYPE_CHECKING:
    from labcrane.analysis.cohort import Participant


class Exporter(Component):
    """What turns recordings into files for other programs.

    Built with the machine that was operated; ``open``, ``begin_trial`` and ``close`` are never
    called.
    """

    shared: ClassVar[tuple[str, ...]] = ()
    """Patterns of files that hold nothing of any participant, as ``read.R``: they stay when one is
    erased. Every other file that may hold a participant's data is edited then, or removed."""

    @abstractmethod
    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        """Write the data of ``participants`` into ``folder``, which exists and is empty.

        Whatever is in it at the end is entered into the register, with the participants in it: a
        file that is named after one participant, and is written while that participant is the last
        that was read, is that one's alone. Its files move to their place afterwards.

        Go through the participants once and keep nothing of one while the next is read: there may
        be hundreds. Every table says the status of each participant; the caller writes down who
        was left out.
        """
