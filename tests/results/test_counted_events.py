"""Events of trials that are no results are told from the others, by name and by column."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from needs import needs

from labcrane.analysis import find_cohort, to_mne
from labcrane.recording import SessionRecord
from labcrane.testing import Command, Order, ch8
from labcrane_bids.bids import Bids
from labcrane_bids.settings import BidsSettings
from results.recorded import record, study

NO_RESULT = "practice|uncounted|void"


@pytest.fixture(scope="module")
def repeated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One person with EEG, one of whose trials was repeated."""
    root = tmp_path_factory.mktemp("repeated")
    record(study(root), root / "data", "P001", eeg=True, orders={900: [Command(Order.REPEAT)]})
    return root / "data"


@pytest.fixture(scope="module")
def session(repeated: Path) -> SessionRecord:
    _, session = next(find_cohort(repeated).included[0].sessions())
    return session


@pytest.fixture(scope="module")
def events(repeated: Path, tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    out = tmp_path_factory.mktemp("bids")
    Bids(BidsSettings(), ch8()).export(iter(find_cohort(repeated).included), out)
    (path,) = out.glob("sub-P001/ses-01/motion/*_events.tsv")
    return pd.read_csv(path, sep="\t", na_values="n/a")


@pytest.mark.slow
def test_in_bids_every_trial_has_its_duration_and_says_whether_it_is_a_result(
    events: pd.DataFrame, session: SessionRecord
) -> None:
    starts = events[events["trial_type"] == "trial_start"].set_index(["trial", "attempt"])
    ends = events[events["trial_type"] == "trial_end"].set_index(["trial", "attempt"])
    np.testing.assert_allclose(starts["duration"], ends["onset"] - starts["onset"], atol=1e-9)
    assert (starts["duration"] > 0.5).all()
    assert starts["response_time"].notna().sum() > len(session.trials)
    rows = session.trials.set_index(["trial", "attempt"])
    results = starts[(starts["counted"] == 1) & (starts["void"] == 0)]
    assert results.index.tolist() == rows.index[rows["outcome"] == "success"].tolist()
    assert (starts["counted"] == 0).sum() >= 2
    assert starts.index[starts["void"] == 1].tolist() == [
        each for each in starts.index if (each[0], each[1] + 1) in starts.index
    ]
    assert (starts["void"] == 1).sum() == 1
    assert set(starts["practice"]) == {0}


@pytest.mark.slow
def test_in_bids_every_event_of_a_trial_says_what_its_trial_is(events: pd.DataFrame) -> None:
    inside = events[events["trial"].notna()]
    for name in ("counted", "void", "direction"):
        starts = inside[inside["trial_type"] == "trial_start"].set_index(["trial", "attempt"])[name]
        entered = inside[inside["trial_type"] == "targets_shown"].set_index(["trial", "attempt"])
        pd.testing.assert_series_equal(entered[name], starts)


@pytest.mark.slow
@needs("mne")
def test_in_mne_results_alone_are_chosen_by_name(session: SessionRecord) -> None:
    import mne

    raw = to_mne(session)
    results = (session.trials["outcome"] == "success").sum()
    for name in ("trial_start", "targets_shown"):
        everything, _ = mne.events_from_annotations(raw, regexp=f"^{name}", verbose="error")
        chosen, ids = mne.events_from_annotations(
            raw, regexp=f"^{name}(?!.*/({NO_RESULT}))", verbose="error"
        )
        assert len(chosen) == results < len(everything) - 2
        assert not [label for label in ids if {"uncounted", "void"} & set(label.split("/"))]
