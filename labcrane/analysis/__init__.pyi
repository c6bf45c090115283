"""The public names of this package, and the modules from which they are imported."""

from .codebook import codebook_of
from .cohort import Participant, find_cohort
from .electrodes.mne import EEG_READERS, channel_types, eeg_streams, events_at, to_mne, volts
from .electrodes.sampled import Sampled, sampled
from .exporter import Exporter
from .measures import measures_of
from .movements import Movement, movements_of
from .questionnaires import answers_of, asked_in, beside_trials, scores_of

__all__ = [
    "EEG_READERS",
    "Exporter",
    "Movement",
    "Participant",
    "Sampled",
    "answers_of",
    "asked_in",
    "beside_trials",
    "channel_types",
    "codebook_of",
    "eeg_streams",
    "events_at",
    "find_cohort",
    "measures_of",
    "movements_of",
    "sampled",
    "scores_of",
    "to_mne",
    "volts",
]
