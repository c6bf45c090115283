"""Settings of exports as BIDS."""

from pathlib import Path
from typing import Annotated

from pydantic import NonNegativeFloat, PositiveInt

from labcrane import Settings
from labcrane.core import Usual


class BidsSettings(Settings):
    """Settings of :class:`~labcrane_bids.bids.Bids`."""

    every: PositiveInt = 1
    """Which ticks are written: 1 for all, 3 for every third. Motion files are text and cannot be
    compressed; the participant file keeps all ticks."""

    shift_dates: bool = True
    """Whether dates are shifted so that each participant's first session is on 1 January 1925.
    Intervals and times of day stay; the real dates cannot be traced."""

    ethics: tuple[str, ...] = ()
    """Ethics approvals, as in ``board, reference``, in addition to those in the recordings."""

    authors: tuple[str, ...] = ()
    """Who made the data set."""

    license: str = ""
    """SPDX name of the licence."""

    people: Path | None = None
    """CSV file with the columns participant, age, sex, handedness and group, as far as known. Its
    values replace the recorded ones."""

    phenotype: Path | None = None
    """Folder of CSV files, one per questionnaire. Each has a column participant, and a JSON file of
    the same name that describes its columns."""

    gaze_system: str = ""
    """Coordinate system of gaze, as in ``gaze-on-screen``. The default follows the unit of x; for
    pixels, the protocol or the stream's header states their picture."""

    eeg_reference: str = ""
    """Position of the EEG's reference electrode, as in ``FCz``; by default what the stream's header
    states."""

    eeg_unit: str = ""
    """Unit of EEG channels whose source states none, as in ``microvolts``."""

    power_line_hz: Annotated[NonNegativeFloat, Usual(15.0, 500.0)] = 0.0
    """Mains frequency where the EEG was recorded, in Hz; with 0, ``mains_hz`` of the protocol's
    monitors."""
