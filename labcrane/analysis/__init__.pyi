"""The public names of this package, and the modules from which they are imported."""

from .codebook import codebook_of, levels_of
from .cohort import Participant, find_cohort
from .electrodes.mne import (
    EEG_READERS,
    GAP,
    bridged,
    channel_types,
    eeg_streams,
    events_at,
    faults_of,
    to_mne,
    volts,
)
from .electrodes.sampled import Sampled, sampled
from .exporter import Exporter
from .gaze import Glass, fixations_of, glass_of, with_unseen_areas
from .gaze_streams import gaze_space
from .measures import measures_of
from .monitor_settings import monitor_setting
from .movements import Movement, movements_of
from .presented import PRESENTED, presentation_failed
from .questionnaires import answers_of, asked_in, beside_trials, scores_of
from .tables.annotations import annotations_of
from .tables.films import films_of
from .tables.responses import measures_by, responses, responses_of

__all__ = [
    "EEG_READERS",
    "GAP",
    "PRESENTED",
    "Exporter",
    "Glass",
    "Movement",
    "Participant",
    "Sampled",
    "annotations_of",
    "answers_of",
    "asked_in",
    "beside_trials",
    "bridged",
    "channel_types",
    "codebook_of",
    "eeg_streams",
    "events_at",
    "faults_of",
    "films_of",
    "find_cohort",
    "fixations_of",
    "gaze_space",
    "glass_of",
    "levels_of",
    "measures_by",
    "measures_of",
    "monitor_setting",
    "movements_of",
    "presentation_failed",
    "responses",
    "responses_of",
    "sampled",
    "scores_of",
    "to_mne",
    "volts",
    "with_unseen_areas",
]
