"""Settings of exports as BIDS."""

from pathlib import Path
from typing import Annotated

from pydantic import NonNegativeFloat, PositiveInt

from labcrane import Settings
from labcrane.core import Usual


class BidsSettings(Settings):
    """Settings of :class:`~labcrane_bids.bids.Bids`."""

    every: PositiveInt = 1
    """Which ticks are written: 1 all of them, 3 every third. Motion files are text and cannot be
    compressed; the participant file keeps all."""

    shift_dates: bool = True
    """Whether dates are moved, for each participant so that the first session is on 1 January
    1925: intervals and times of day stay, dates cannot be traced."""

    ethics: tuple[str, ...] = ()
    """Ethics approvals, as in ``board, reference``; those in the recordings are added."""

    authors: tuple[str, ...] = ()
    """Who made the data set."""

    license: str = ""
    """SPDX name of the licence."""

    people: Path | None = None
    """A CSV file with the columns participant, age, sex, handedness and group, as far as known;
    what it says replaces what was recorded."""

    phenotype: Path | None = None
    """A folder of CSV files, one per questionnaire, each with a column participant and a JSON file
    of the same name that says what its columns are."""

    gaze_system: str = ""
    """What gaze is measured in, as ``gaze-on-screen``; by default as the unit of x says, and of
    pixels what the protocol or the stream's header says that they are of."""

    eeg_reference: str = ""
    """Where the reference electrode of EEG was, as in ``FCz``."""

    eeg_unit: str = ""
    """Unit of channels of EEG whose source states none, as in ``microvolts``."""

    power_line_hz: Annotated[NonNegativeFloat, Usual(15.0, 500.0)] = 0.0
    """Frequency of the mains where EEG was recorded; 0 where it is not known."""
