"""Words that look like numbers, truths or missing values, through tables to what reads them."""

import random
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from once import made_once
from scipy.stats import f_oneway

from labcrane.analysis import find_cohort
from labcrane.testing import Study, plan_session
from labcrane_matlab.matlab import Matlab
from labcrane_matlab.settings import MatlabSettings
from labcrane_tables.settings import TableSettings
from labcrane_tables.tables import Tables
from results.consumers import needs_octave, needs_r, octave, r, table
from results.recorded import STUDY, record, study

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("words")]

DICE = random.Random(70)
LOOK_ALIKE = ["T", "F", "TRUE", "1e5", "0x1F", "2026-05-01", "Inf", "yes", "007", "-3", "2i"]
GROUPS = ["10", "2", DICE.choice(LOOK_ALIKE), "1"]
"""In an order that neither the alphabet nor size gives."""

CHOICES = ["3", "1e5", "no", "1"]
LEVELS = ", ".join(f"{name!r}: []" for name in GROUPS)
QUESTION = f"{{name: which, text: Which?, kind: choice, choices: {CHOICES}}}"
ASKED = f"questionnaires:\n  mine: {{use: free, title: Mine, questions: [{QUESTION}]}}\n"
TEXT = (
    STUDY.replace("pattern: 'P\\d{3}', planned: 4", "pattern: '[0-9ex]+', planned: 8")
    .replace("design:\n", f"{ASKED}design:\n  groups: {{{LEVELS}}}\n")
    .replace("block: {task: aiming}", "block: {task: aiming, ask: [mine]}")
)


def people_of(chosen: Study) -> list[str]:
    """Return two people of each group; no two of them are the same number."""
    drawn = [f"{number:03}" for number in range(1, 60)] + ["1e2", "0x50", "2e03", "00077"]
    DICE.shuffle(drawn)
    found: dict[str, list[str]] = {}
    for who in drawn:
        found.setdefault(plan_session(chosen, who, 1).group, []).append(who)
    return sorted(who for own in found.values() for who in own[:2])


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_once("words", _export, tmp_path_factory.mktemp("words"))


def _export(root: Path) -> None:
    chosen = study(root, TEXT)
    for who in people_of(chosen):
        record(chosen, root / "data", who)
    people = find_cohort(root / "data").included
    for name, exporter in (
        ("tables", Tables(TableSettings(streams="csv"))),
        ("matlab", Matlab(MatlabSettings(streams=False))),
    ):
        (root / name).mkdir()
        exporter.export(iter(people), root / name)


def recorded(exports: Path) -> list[str]:
    return sorted(path.name for path in (exports / "data").iterdir() if path.is_dir())


def known(exports: Path) -> pd.DataFrame:
    """Return the trials as they are written, every cell a text."""
    return pd.read_csv(exports / "tables" / "trials.csv", dtype=str, keep_default_na=False)


def test_what_is_written_has_every_name_as_it_was(exports: Path) -> None:
    trials = known(exports)
    assert sorted(trials["participant"].unique()) == recorded(exports)
    assert set(trials["group"]) == set(GROUPS)


@needs_r
def test_r_reads_names_as_text_and_groups_in_the_order_of_the_design(exports: Path) -> None:
    said = table(
        r(
            """
source(file.path(commandArgs(TRUE)[1], "read.R")); s <- read_labcrane(commandArgs(TRUE)[1])
own <- aggregate(movement_time ~ participant + group, s$trials, mean)
line <- function(...) cat(..., sep = "|", fill = 1e6)
line("people", unique(s$trials$participant))
line("register", s$participants$participant)
line("events", unique(s$events$participant))
line("groups", levels(s$trials$group)); line("choices", levels(s$trials$mine_which))
test <- anova(lm(movement_time ~ group, own))
line("test", test$Df, sprintf("%.12g", test[["F value"]][1]))
line("stream", class(s$streams[[1]]$time), sum(is.na(s$streams[[1]]$time)))
""",
            exports / "tables",
        )
    )
    assert said["people"] == said["register"] == said["events"] == recorded(exports)
    assert said["groups"] == GROUPS
    assert said["choices"] == CHOICES
    trials = known(exports).astype({"movement_time": float})
    means = trials.groupby(["group", "participant"])["movement_time"].mean()
    by_group = [own.to_numpy() for _, own in means.groupby("group")]
    expected = [
        len(GROUPS) - 1,
        len(recorded(exports)) - len(GROUPS),
        f_oneway(*by_group).statistic,
    ]
    np.testing.assert_allclose(np.array(said["test"], float), expected, rtol=1e-9)
    assert said["stream"] == ["numeric", "0"]


@needs_octave
def test_octave_reads_names_as_text(exports: Path) -> None:
    said = table(
        octave(
            """addpath(argument); s = read_labcrane(argument);
printf('people|%s\\n', strjoin(unique(s.trials.participant)', '|'));
printf('groups|%s\\n', strjoin(unique(s.trials.group)', '|'));""",
            exports / "matlab",
        )
    )
    assert said == {"people": recorded(exports), "groups": sorted(GROUPS)}


def test_pandas_reads_names_as_text_from_parquet(exports: Path) -> None:
    folder = exports / "tables"
    trials, people = (pd.read_parquet(folder / f"{n}.parquet") for n in ("trials", "participants"))
    assert (
        sorted(people["participant"]) == sorted(trials["participant"].unique()) == recorded(exports)
    )
    assert set(trials["group"]) == set(GROUPS)
    assert set(trials["mine_which"].dropna()) <= set(CHOICES)
    assert trials["mine_which"].notna().any()
    book = pd.read_csv(folder / "codebook.csv", keep_default_na=False)
    group = book.query("table == 'trials' and column == 'group'").iloc[0]
    assert (group["type"], group["levels"].split("\n")) == ("text", GROUPS)
