"""Films table: the files of cameras, microphones and screens next to a participant file."""

from typing import TYPE_CHECKING

from labcrane.analysis.cohort import Participant

if TYPE_CHECKING:
    import pandas as pd


def films_of(participant: Participant) -> "pd.DataFrame":
    """Return one row per file: its name, when it begins and ends, and how right its times are.

    ``time`` and ``until`` are of its first and last frame, in seconds on the session's clock.
    """
    import pandas as pd

    return pd.DataFrame(
        participant.rows(
            lambda session: (row for film in session.films.values() for row in film.listed())
        )
    )
