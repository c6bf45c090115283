"""What the operator was shown of each movement, and which movements that leaves out."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import labcrane as lab
from labcrane.analysis import PRESENTED
from labcrane.analysis.codebook import trial_codebook
from labcrane.analysis.measures import measure_session
from labcrane.analysis.presented import (
    PresentedLimits,
    _fewest,
    not_presented,
    operators_views,
    presented,
)
from labcrane.analysis.quality import exclusions, is_result, verdict_of_stamps
from labcrane.analysis.report.answer import _exclusions
from labcrane.analysis.report.outcomes import practised
from labcrane.analysis.statistics.time_outs import time_outs
from labcrane.core import Finding, Verdict
from labcrane.core.findings import worst
from labcrane.launcher.launcher import Outcome
from labcrane.launcher.pages import left_behind
from labcrane.recording import SessionRecord
from labcrane.session.commands import FeedbackLost, FeedbackReady, Message
from labcrane.session.visit import visit_of
from labcrane.streams.feedback_log import log_name
from labcrane.streams.recorder.health import Flow, rate_of
from labcrane.streams.sync.report.sync_report import SyncReport
from labcrane.testing import Command, Order
from labcrane_bids.events import event_description, event_table
from results.recorded import STUDY, record, study
from results.synthetic import cohort_of_36

VIEWED = STUDY.replace("tasks:\n", "views: {cab: {use: view}}\ntasks:\n", 1)
RATE_HZ = 120


def recorded(
    folder: Path,
    pictures: Mapping[str, np.ndarray],
    orders: Mapping[int, Sequence[Message]] | None = None,
    text: str = VIEWED,
) -> SessionRecord:
    shown = {name: lambda _, times=times: times for name, times in pictures.items()}
    path = record(study(folder, text), folder / "data", "P001", orders=orders, shown=shown)
    return lab.open_recording(path).session(1)


def drawn(seed: int, rate_hz: float = 40.0) -> np.ndarray:
    """Return when pictures were shown: about so many a second, and four outages of up to 4 s."""
    random = np.random.default_rng(seed)
    shown = 95.0 + np.cumsum(random.gamma(4.0, 0.25 / rate_hz, 10_000))
    for began in random.uniform(100.0, 125.0, 4):
        shown = shown[(shown < began) | (shown > began + random.uniform(0.3, 4.0))]
    return shown


def walked(session: SessionRecord, shown: np.ndarray) -> list[tuple[int, float]]:
    """Return pictures and longest time without one of each trial, tick by tick as they went by."""
    loop = session.streams["loop"].data
    found = []
    for _, row in session.trials.iterrows():
        count, without, longest = 0, 0, 0
        for due, paused in zip(loop["due"], loop["paused"], strict=True):
            if paused or not row["started"] <= due < row["ended"] - 1e-9:
                continue
            new = int(((shown >= due) & (shown < due + 1 / RATE_HZ)).sum())
            count, without = count + new, 0 if new else without + 1
            longest = max(longest, without)
        found.append((count, longest / RATE_HZ))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_was_shown_of_a_movement_is_what_goes_by_tick_by_tick(
    tmp_path: Path, seed: int
) -> None:
    shown = drawn(seed)
    pauses = {800: [Command(Order.PAUSE)], 1100: [Command(Order.START)]}
    session = recorded(tmp_path, {"cab": shown}, pauses)
    assert session.trials["paused"].max() == pytest.approx(300 / RATE_HZ, abs=1.5 / RATE_HZ)
    table = presented(session)
    assert table is not None
    (counts, longest) = zip(*walked(session, shown), strict=True)
    assert np.abs(table["pictures"] - np.array(counts)).max() <= 1  # at the edge of a pause
    np.testing.assert_allclose(table["longest_without_picture"], longest, atol=2.01 / RATE_HZ)
    seconds = session.trials["ended"] - session.trials["started"] - session.trials["paused"]
    seconds = seconds.clip(upper=1.0)  # in a second of each, at most what there was in all
    assert (table["fewest_pictures"] <= table["pictures"] / seconds + 1e-9).all()
    failed = (table["longest_without_picture"] > 0.25) | (table["fewest_pictures"] < 15.0)
    assert table["presentation_failed"].tolist() == failed.astype(float).tolist()
    assert 0 < failed.sum() < len(table)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> tuple[SessionRecord, pd.Series]:
    """Return a session whose second view stood still for 2 s in its third trial, and that trial."""
    folder = tmp_path_factory.mktemp("stopped")
    first = recorded(folder / "before", {"cab": drawn(1)})
    third = first.trials.iloc[2]
    still = third["started"] + 0.5
    whole = np.arange(90.0, 400.0, 1 / 60)
    gone = whole[(whole < still) | (whole >= still + 2.0)]
    text = VIEWED.replace("{cab: {use: view}}", "{cab: {use: view}, side: {use: view}}")
    return recorded(folder, {"cab": whole, "side": gone}, text=text), third


def test_a_movement_is_left_out_by_reason_where_one_of_two_views_stood_still(
    stopped: tuple[SessionRecord, pd.Series],
) -> None:
    session, third = stopped
    table = measure_session(session).assign(participant="P001", session=1)
    assert table.loc[not_presented(table), "trial"].tolist() == [third["trial"]]
    row = table[not_presented(table)].iloc[0]
    seconds = third["ended"] - third["started"]
    assert row["longest_without_picture"] == pytest.approx(2.0, abs=2 / 60)
    assert row["pictures"] == pytest.approx((seconds - 2.0) * 60, abs=2)
    others = table[~not_presented(table)]
    assert others["longest_without_picture"].max() == pytest.approx(1 / 60, abs=1e-3)
    (why,) = exclusions(table)["why"]
    assert why == (
        f"outcome success, {row['pictures']:.0f} pictures shown, 0 in the worst second, "
        "none for 2.02 s"
    )
    assert (is_result(table) == ~not_presented(table)).all()


@pytest.mark.slow
def test_a_slow_second_leaves_out_a_movement_that_was_fast_before_and_after(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "before"
    third = recorded(folder, {"cab": drawn(1)}).trials.iloc[2]
    slow, over = third["started"] + 0.5, third["started"] + 2.0
    fast = np.arange(90.0, 400.0, 1 / 120)
    shown = np.r_[fast[fast < slow], np.arange(slow, over, 0.19), fast[fast > over]]
    session = recorded(tmp_path / "slow", {"cab": shown})
    table = measure_session(session).assign(participant="P001", session=1)
    row = table.iloc[2]
    assert row["pictures"] / (third["ended"] - third["started"]) > 40.0
    assert row["longest_without_picture"] == pytest.approx(0.19)
    assert row["fewest_pictures"] == 5.0
    assert not_presented(table).tolist() == [number == 2 for number in range(len(table))]
    (why,) = exclusions(table)["why"]
    assert why.endswith(" pictures shown, 5 in the worst second, none for 0.19 s")
    (finding,) = session.sync_report["presented"]
    assert "5 in the worst second" in finding["text"]


@pytest.mark.parametrize("seed", range(5))
def test_the_fewest_pictures_are_those_of_the_worst_second_wherever_it_begins(seed: int) -> None:
    random = np.random.default_rng(seed)
    shown = np.sort(random.uniform(10.0, 16.0, random.integers(0, 60)))
    every = np.arange(10.0, 15.0, 1e-3)
    worst = min(np.searchsorted(shown, every + 1.0) - np.searchsorted(shown, every))
    assert _fewest(shown, 10.0, 16.0) == pytest.approx(worst, abs=1.0)
    assert _fewest(shown, 10.0, 16.0) <= worst
    early = shown[shown < 10.5]
    assert _fewest(early, 10.0, 10.5) == len(early) / 0.5, "shorter than a second: the whole"


def test_the_lamp_counts_the_same_seconds_as_the_table() -> None:
    flow = Flow()
    for time in (*np.arange(0.0, 4.0, 1 / 120), *np.arange(4.0, 5.3, 0.2)):
        flow.came(time, 1)
    assert rate_of(log_name("cab"), flow, 5.25) == 5.0
    assert rate_of("eyes", flow, 5.25) > 60.0
    assert rate_of(log_name("cab"), flow, 0.9) is None
    assert PresentedLimits().too_little(5.0, 0.2)


def test_the_sync_report_names_movements_that_were_not_shown(
    stopped: tuple[SessionRecord, pd.Series],
) -> None:
    session, third = stopped
    (finding,) = session.sync_report["presented"]
    assert session.sync_report["verdict"] == finding["verdict"] == "FAIL"  # 1 of 8 is over 5 %
    assert (
        f"in 1 of {len(session.trials)} movements the operator saw or heard too little"
        in (finding["text"])
    )
    assert f"trial {third['trial']:g}: " in finding["text"]
    assert "none for 2.02 s" in finding["text"]


def test_labels_and_events_of_bids_name_movements_that_were_not_shown(
    stopped: tuple[SessionRecord, pd.Series],
) -> None:
    session, third = stopped
    table = event_table(session)
    of_it = (table["trial"] == third["trial"]) & (table["attempt"] == third["attempt"])
    assert of_it.sum() > 2
    assert (table.loc[of_it, "presentation_failed"] == 1).all()
    assert (table.loc[of_it, "void"] == 0).all(), "it is not what was broken off or made again"
    assert table.loc[of_it, "label"].str.contains("/presentation_failed").all()
    counted = table["trial"].isin(session.trials["trial"]) & ~of_it
    assert (table.loc[counted, "presentation_failed"] == 0).all()
    assert table.loc[table["trial"].isna(), "presentation_failed"].isna().all()
    assert not table.loc[~of_it, "label"].str.contains("presentation_failed").any()
    meaning = event_description(table, session.context, {})["presentation_failed"]["Description"]
    assert meaning == PRESENTED["presentation_failed"][1]


def test_a_report_and_the_study_page_tell_time_stamps_from_what_was_shown(
    stopped: tuple[SessionRecord, pd.Series],
) -> None:
    report = stopped[0].sync_report
    assert report["verdict"] == "FAIL"
    judged = [one["verdict"] for one in report["streams"]]
    assert verdict_of_stamps(report) == worst(map(Verdict, judged)).value != "FAIL"
    bad = {"verdict": "FAIL"}
    for part in ({"streams": [*report["streams"], bad]}, {"missing": [bad]}, {"loop": bad}):
        assert verdict_of_stamps({**report, **part}) == "FAIL"
    assert verdict_of_stamps({"verdict": "WARN", "streams": []}) == "WARN", "recorded before"
    assert verdict_of_stamps({}) == ""


def test_every_column_of_what_was_shown_is_in_the_codebook(
    stopped: tuple[SessionRecord, pd.Series],
) -> None:
    book = trial_codebook(measure_session(stopped[0]), [stopped[0].context]).set_index("column")
    for name, (unit, meaning) in PRESENTED.items():
        assert tuple(book.loc[name, ["unit", "description"]]) == (unit, meaning)


@pytest.mark.slow
def test_the_protocol_says_how_much_is_too_little(tmp_path: Path) -> None:
    shown = np.arange(90.0, 400.0, 1 / 20)
    for limits, failed in (("", 0.0), ("presented: {min_hz: 30}\n", 1.0),
                           ("presented: {max_gap_s: 0.04}\n", 1.0)):  # fmt: skip
        folder = tmp_path / str(len(limits))
        session = recorded(folder, {"cab": shown}, text=VIEWED + limits)
        assert set(measure_session(session)["presentation_failed"]) == {failed}


def _paused_for_a_view(folder: Path, dark_s: float) -> SessionRecord:
    """Return a session that was paused for 2.5 s in its first movement, its view having failed.

    The view was dark for so long before that was known.
    """
    text = VIEWED + "on_fault: {feedback_lost: pause}\n"
    orders = {800: [FeedbackLost("cab", "it died")], 1100: [FeedbackReady("cab", "renderer x")]}
    lost, back = 100.0 + 800 / RATE_HZ, 100.0 + 1100 / RATE_HZ
    whole = np.arange(90.0, 400.0, 1 / 60)
    shown = whole[(whole < lost - dark_s) | (whole >= back - 0.01)]
    return recorded(folder, {"cab": shown}, orders, text)


@pytest.mark.slow
def test_a_view_that_failed_is_lost_in_a_pause_too_and_the_report_says_so(tmp_path: Path) -> None:
    session = _paused_for_a_view(tmp_path, 0.1)
    table = measure_session(session).assign(participant="P001", session=1)
    first = table.iloc[0]
    assert first["paused"] == pytest.approx(2.5, abs=0.02)
    assert first["feedback_lost"] == pytest.approx(2.5, abs=0.02)
    assert set(table["feedback_lost"].iloc[1:]) == {0.0}
    assert first["longest_without_picture"] == pytest.approx(0.1, abs=0.03)
    assert not not_presented(table).any(), "the machine was held while nothing was seen"
    (finding,) = session.sync_report["interrupted"]
    assert finding["verdict"] == session.sync_report["verdict"] == "WARN"
    assert finding["text"].startswith(f"in 1 of {len(table)} movements a view or sound had failed")
    assert f"feedback lost for {first['feedback_lost']:.2f} s" in finding["text"]
    told = {"verdict": "WARN", "streams": [], "loop": None, "missing": [], "interrupted": [finding]}
    assert verdict_of_stamps(told) == "PASS"


@pytest.mark.slow
def test_a_view_that_was_dark_before_the_pause_for_it_leaves_out_the_movement(
    tmp_path: Path,
) -> None:
    session = _paused_for_a_view(tmp_path, 0.4)
    table = measure_session(session)
    assert not_presented(table).tolist() == [number == 0 for number in range(len(table))]
    assert table["longest_without_picture"].iloc[0] == pytest.approx(0.4, abs=0.03)
    assert "interrupted" not in session.sync_report
    assert "feedback lost for 2.5" in session.sync_report["presented"][0]["text"]


@pytest.mark.slow
def test_a_view_that_never_showed_a_picture_has_shown_none_of_any_movement(tmp_path: Path) -> None:
    session = recorded(tmp_path, {}, {5: [FeedbackLost("cab", "no driver")]})
    table = measure_session(session)
    assert set(table["pictures"]) == {0.0}
    assert not_presented(table).all()
    seconds = session.trials["ended"] - session.trials["started"]
    np.testing.assert_allclose(table["longest_without_picture"], seconds, atol=1e-9)


@pytest.mark.slow
def test_a_sound_that_was_lost_leaves_out_the_movements_in_which_it_was_on(tmp_path: Path) -> None:
    text = STUDY.replace("tasks:\n", "feedback: {tone: {use: sonification}}\ntasks:\n", 1)
    text = text.replace("{task: aiming}", "{task: aiming, feedback: [tone], fading: [1, 0]}")
    orders = {800: [FeedbackLost("tone", "no device")], 6500: [FeedbackReady("tone", "driver x")]}
    session = recorded(tmp_path, {}, orders, text)
    table = measure_session(session).assign(participant="P001", session=1)
    lost, back = (
        session.events.loc[session.events["name"] == f"feedback.{name}", "time"].iloc[0]
        for name in ("lost", "ready")
    )
    within = np.minimum(table["ended"], back) - np.maximum(table["started"], lost)
    expected = within.clip(lower=0.0).where(table["feedback"] == "tone", 0.0)
    np.testing.assert_allclose(table["feedback_lost"], expected, atol=1 / RATE_HZ)
    assert not_presented(table).tolist() == (expected > 0.25).tolist()
    assert 0 < not_presented(table).sum() < (within > 0.25).sum(), "one without sound, in between"
    assert exclusions(table)["why"].iloc[0] == (
        f"outcome success, feedback lost for {table['feedback_lost'].iloc[0]:.2f} s"
    )
    (finding,) = session.sync_report["presented"]
    assert f": feedback lost for {table['feedback_lost'].iloc[0]:.2f} s; " in finding["text"]


def test_practice_is_compared_with_what_was_shown_alone() -> None:
    table = cohort_of_36().assign(outcome="success", practice=0.0, presentation_failed=0.0)
    table.loc[table["trial"] < 3, ["practice", "presentation_failed"]] = 1.0
    table.loc[table["trial"] == 3, "practice"] = 1.0
    done = practised(table)
    assert set(done.loc[done["practice"] == "practice", "trial"]) == {3}
    assert len(done) == (table["presentation_failed"] == 0.0).sum()


@pytest.mark.slow
def test_where_nothing_was_to_be_shown_nothing_is_missing(tmp_path: Path) -> None:
    hidden = VIEWED.replace("{use: view}", "{use: view, display: hidden}")
    others = VIEWED.replace("{use: view}", "{use: view, seen_by: examiner}")
    for number, (text, pictures) in enumerate(
        ((STUDY, {}), (VIEWED, {}), (hidden, {"cab": drawn(1)}), (others, {"cab": drawn(1)}))
    ):
        session = recorded(tmp_path / str(number), pictures, text=text)
        table = measure_session(session)
        assert not set(PRESENTED) & set(table), text
        assert is_result(table).all()
        assert "presented" not in session.sync_report


def test_only_views_on_a_screen_before_the_operator_are_the_operator_s() -> None:
    own = {"use": "view", "settings": {"seen_by": "operator", "display": "window"}}
    assert operators_views({
        "views.cab": own,
        "views.plain": {"use": "someones_view"},
        "views.desk": {"use": "view", "settings": {"seen_by": "examiner"}},
        "views.film": {"use": "view", "settings": {"display": "hidden"}},
        "feedback.ball": {"use": "sphere"},
    }) == ["cab", "plain"]  # fmt: skip


def test_what_was_not_shown_is_no_success_and_no_time_out_and_is_told_in_the_answer() -> None:
    table = cohort_of_36().assign(outcome="success", practice=0.0, session=1.0, attempt=1.0)
    table = table.assign(started=0.0, ended=3.0, presentation_failed=np.nan)
    table.loc[(table["participant"] == "P003") & (table["trial"] < 3), "presentation_failed"] = 1.0
    table.loc[table["participant"] == "P004", "presentation_failed"] = 0.0
    assert time_outs(table, ["distance"])["trials"].sum() == len(table) - 2
    assert _exclusions(table).endswith(
        "The operator saw or heard too little of 2, from 1 participant: P003 trial 1, P003 trial 2."
    )


def test_a_view_is_complained_about_as_it_is_now() -> None:
    limits = PresentedLimits()
    assert limits.complaint(24.6, 0.2) == ""
    assert limits.complaint(None, 0.2) == ""
    assert limits.complaint(2.04, 0.4) == "shows 2.0 pictures a second, and 15 are needed"
    assert limits.complaint(0.0, 1.2) == "has shown no picture for 1 s"
    assert limits.complaint(24.6, 3.2) == "has shown no picture for 3 s"
    assert limits.complaint(None, None) == "has shown no picture yet"
    assert PresentedLimits(max_gap_s=5.0).complaint(24.6, 3.2) == ""


def test_the_page_at_the_end_tells_an_interruption_from_what_was_not_shown(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(VIEWED, encoding="utf-8")
    order = visit_of(tmp_path / "study.yaml", "P001", 1, tmp_path / "data", simulated=True)
    outcome = Outcome()
    found = (Finding(Verdict.WARN, "what was found", "what to do"),)
    for report, said in (
        (SyncReport((), presented=found), "the operator saw or heard too little"),
        (SyncReport((), interrupted=found), "it was paused for a view or sound that had failed"),
    ):
        page = left_behind(order, outcome, report)
        assert (page.verdict, page.level) == (f"The session is complete and saved; {said}", "warn")
        assert page.advice == ("WARN feedback: what was found; what to do",)
