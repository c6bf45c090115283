"""An awkward cohort: unlike people, answers that a spreadsheet would take for formulas."""

from collections.abc import Mapping
from pathlib import Path

from governed import GOVERNED, Lab

from labcrane.analysis import find_cohort
from labcrane.analysis.cohort import Status
from labcrane.testing import main, run
from results.answering import Answering
from results.undrawn import without_figures

STUDY = (
    GOVERNED.replace("movements: 1", "movements: 2")
    .replace(
        "sessions:",
        """design:
  groups: {no tone: [], loud: [tone]}
feedback: {tone: {use: sonification}}
questionnaires:
  about: {use: demographics, ask: [age, sex, handedness]}
  why:
    use: free
    title: Gründe
    questions: [{name: why, text: 'Warum?', kind: text, required: false}]
  accuracy: {use: subjective_accuracy}
sessions:""",
    )
    .replace(
        "  - name: only\n    steps:\n      - block: {task: aiming, pairs: 1}",
        """  - name: first
    steps:
      - questionnaire: about
      - questionnaire: nasa_tlx
      - block: {task: aiming, pairs: 1, ask: [accuracy]}
      - questionnaire: nasa_tlx
      - questionnaire: why
  - name: second
    steps:
      - block: {task: aiming, pairs: 1}""",
    )
)
"""Two sessions; asked once, after each trial, and twice in a session."""

ROOT = "Übung am Kran"
FORMULA, NULL = "=1+1", "null"
TLX = ("mental", "physical", "temporal", "performance", "effort", "frustration")
ASKED = {
    "about": ("age", "sex", "handedness"),
    "nasa_tlx": TLX,
    "accuracy": ("rating",),
    "why": ("why",),
}
ANSWERS: Mapping[str, Mapping[str, object]] = {
    "P001": {"age": 24, "sex": "female", "handedness": "right", "why": FORMULA, "rating": 8},
    "P002": {"age": 31, "sex": "male", "handedness": "both", "why": NULL, "rating": 2},
    "P003": {"age": 91, "sex": "other", "handedness": "left"},
    "P004": {"age": None, "sex": None, "handedness": None, "why": "Zeile\nzwei", "rating": 5},
}
"""What each of them answers; the workload is their number, later twice as much."""

HALF_FINISHED, ONCE = "P003", "P004"
"""Who ends the first session before its first trial is rated, and who misses the second."""


class OneOfThem(Answering):
    """Answers as one of them does: the workload is higher each time."""

    def __init__(self, participant: str, leaves: str = "") -> None:
        super().__init__({}, leaves)
        self._own = ANSWERS[participant]
        self._load = 10 * int(participant[-1])
        self._asked: list[str] = []

    def given(self, name: str) -> Mapping[str, object]:
        self._asked.append(name)
        every = dict.fromkeys(TLX, self._load * self._asked.count(name)) | self._own
        return {item: value for item, value in every.items() if item in ASKED[name]}


def awkward_lab(folder: Path) -> Lab:
    """Record the cohort below a folder with umlauts and spaces, without a clock to wait for."""
    root = folder / ROOT
    root.mkdir()
    lab = Lab(root, STUDY)
    lab.approve()
    for name in ANSWERS:
        lab.consent(name)
        leaves = "accuracy" if name == HALF_FINISHED else ""
        run(lab.visit(name, fast=True), OneOfThem(name, leaves))
        if name not in {HALF_FINISHED, ONCE}:
            run(lab.visit(name, 2, fast=True), OneOfThem(name))
    return lab


class Awkward:
    """The cohort, and its exports by the command, each made when it is first asked for.

    Tests that use it are in one group of processes, ``xdist_group("awkward")``, so that all of it
    is made once per run. Nobody changes what is in it.
    """

    def __init__(self, folder: Path) -> None:
        self.lab = awkward_lab(folder)
        self.data = self.lab.places.root
        self.cohort = find_cohort(self.data, [Status.HALF_FINISHED])

    def report(self) -> Path:
        """Return the folder of a report on everybody."""
        folder = self.lab.folder / "report"
        if not folder.exists():
            words = ["report", str(self.data), "--out", str(folder)]
            with without_figures():
                assert main([*words, "--include", "half-finished"]) == 0
        return folder

    def export(self, to: str) -> Path:
        """Return the folder of an export of everybody."""
        folder = self.lab.folder / "exports" / to
        if not folder.exists():
            words = ["export", str(self.data), "--to", to, "--out", str(folder)]
            asked = ["--set", "license=CC0-1.0"] if to == "zip" else []
            assert main([*words, *asked, "--include", "half-finished"]) == 0
        return folder
