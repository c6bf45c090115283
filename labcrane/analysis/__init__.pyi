"""The public names of this package, and the modules from which they are imported."""

from .codebook import codebook_of
from .cohort import Participant, find_cohort
from .exporter import Exporter
from .measures import measures_of
from .movements import Movement, movements_of
from .questionnaires import answers_of, asked_in, scores_of
from .tables.dataset import Dataset, open_dataset

__all__ = [
    "Dataset",
    "Exporter",
    "Movement",
    "Participant",
    "answers_of",
    "asked_in",
    "codebook_of",
    "find_cohort",
    "measures_of",
    "movements_of",
    "open_dataset",
    "scores_of",
]
