"""A short study that feeds back."""

from rehearsal import SHORT

FED = SHORT.replace(
    "sessions:",
    """feedback:
  ball: {use: sphere, far: 3.0}
  tone: {use: sonification, far: 3.0, pan: none, silent_after_s: null}
design:
  groups: {none: [], visual: [ball], auditory: [tone], both: [ball, tone]}
sessions:""",
)
