"""The aiming task: its geometry, when a movement begins and ends, and its measures."""

import itertools
import math

import numpy as np
import pytest

from labcrane import ProtocolError, Task
from labcrane.core import Phase
from labcrane.machines import load_machine, reach
from labcrane.testing import TaskContract, ch8, crane_at, make_frame, make_run, make_trial, opened
from labcrane_aiming import labcrane_tasks
from labcrane_aiming.aiming import Aiming
from labcrane_aiming.pairs import index_of_difficulty, pairs
from labcrane_aiming.settings import AimingSettings

RATE_HZ = 240.0


class TestContract(TaskContract):
    @pytest.fixture
    def task(self) -> Task:
        offer = {offer.name: offer for offer in labcrane_tasks()}["aiming"]
        return offer.build(AimingSettings(), ch8())


# Far and near end points of the proposed geometry, x and y in m, and index of difficulty.
GEOMETRY = {
    2: ((6.207, 0.707), (4.793, -0.707), 2.322),
    3: ((6.561, 1.061), (4.439, -1.061), 2.807),
    4: ((6.914, 1.414), (4.086, -1.414), 3.170),
    6: ((7.621, 2.121), (3.379, -2.121), 3.700),
}


@pytest.mark.parametrize(("distance", "expected"), GEOMETRY.items())
def test_the_default_geometry_is_the_proposed_one(distance: float, expected: tuple) -> None:
    far, near, difficulty = expected
    left, right = (pair for pair in pairs(AimingSettings()) if pair.distance == distance)
    assert left.far[:2] == pytest.approx(far, abs=5e-4)
    assert left.near[:2] == pytest.approx(near, abs=5e-4)
    assert right.far[:2] == pytest.approx((far[0], -far[1]), abs=5e-4)
    assert math.dist(left.far, left.near) == pytest.approx(distance)
    assert index_of_difficulty(distance, 0.5) == pytest.approx(difficulty, abs=5e-4)


@pytest.mark.parametrize("machine", ["ch8", "ch8_cranelike"])
def test_both_machines_reach_all_sixteen_circles(machine: str) -> None:
    for pair in pairs(AimingSettings()):
        for point in (pair.near, pair.far):
            assert reach(load_machine(machine), point) is not None


def test_a_block_has_32_counted_movements_each_from_where_the_last_one_ended() -> None:
    task = Aiming(AimingSettings(), ch8())
    plan = task.plan(task.factors())
    assert sum(planned.counted for planned in plan) == 32
    assert sum(not planned.counted for planned in plan) == 8
    for before, after in itertools.pairwise(plan):
        if after.counted:
            for axis in "xyz":
                assert before.condition[f"target_{axis}"] == after.condition[f"start_{axis}"]


def test_a_circle_out_of_reach_is_refused() -> None:
    with pytest.raises(ProtocolError, match=r"is out of reach of the CH8 .*; move the centre"):
        Aiming(AimingSettings(distances=(14.0,)), ch8())


class Path:
    """Plays a tip path to the task: positions along the way from start to target."""

    def __init__(self, **settings: object) -> None:
        self.task = Aiming(AimingSettings(distances=(2.0,), **settings), ch8())
        self.planned = self.task.plan(self.task.factors())[1]  # near to far
        self.start = np.array([self.planned.condition[f"start_{axis}"] for axis in "xyz"])
        self.target = np.array([self.planned.condition[f"target_{axis}"] for axis in "xyz"])

    def play(self, fractions, *, trigger=(), commands=()):
        run = make_run(ch8(), task=self.task.signals)
        tip, velocity = run.state.find("tip.position"), run.state.find("tip.velocity")
        positions = self.start + np.outer(fractions, self.target - self.start)
        speeds = np.gradient(positions, 1 / RATE_HZ, axis=0)
        judgements = []
        with opened(self.task, run):
            self.task.begin_trial(make_trial(self.planned))
            for number, (position, speed) in enumerate(zip(positions, speeds, strict=True)):
                frame = make_frame(run, number, crane_at(run.machine, run.machine.rest))
                frame.state[tip], frame.state[velocity] = position, speed
                frame.axes[run.axes.index("right.trigger")] = number in trigger
                frame.command[0] = number in commands
                judgements.append(self.task.evaluate(frame))
                if judgements[-1].phase.over:
                    break
        return judgements


def minimum_jerk(seconds: float, before: float = 0.5, after: float = 1.0, end: float = 1.0):
    """Fractions of the way: at rest, a minimum-jerk movement, at rest."""
    s = np.arange(0, seconds, 1 / RATE_HZ) / seconds
    way = end * (10 * s**3 - 15 * s**4 + 6 * s**5)
    return np.concatenate(
        [np.zeros(round(before * RATE_HZ)), way, np.full(round(after * RATE_HZ), end)]
    )


def minimum_jerk_speed(s: float) -> float:
    """Fraction of the way per movement time."""
    return 30 * s**2 - 60 * s**3 + 30 * s**4


def crossing(speed: float) -> float:
    """The share of a minimum-jerk movement after which it is faster than ``speed``."""
    low, high = 0.0, 0.5
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if minimum_jerk_speed(middle) < speed else (low, middle)
    return low


def test_onset_and_offset_are_where_the_speed_crosses_the_thresholds() -> None:
    seconds, distance = 2.0, 2.0
    judgements = Path().play(minimum_jerk(seconds))
    results = judgements[-1].results
    peak = minimum_jerk_speed(0.5) * distance / seconds
    onset = crossing(0.02 * seconds / distance) * seconds
    offset = (1 - crossing(0.02 * seconds / distance)) * seconds
    assert judgements[-1].phase is Phase.SUCCESS
    assert results["movement_onset"] == pytest.approx(0.5 + onset, abs=1.5 / RATE_HZ)
    assert results["movement_time"] == pytest.approx(offset - onset, abs=2.5 / RATE_HZ)
    assert results["peak_speed"] == pytest.approx(peak, rel=1e-3)


@pytest.mark.parametrize("hold_s", [0.0, 0.1, 0.3])
def test_the_onset_is_told_once_it_is_held_stamped_when_it_was_and_says_how_late(
    hold_s: float,
) -> None:
    judgements = Path(onset_hold_s=hold_s).play(minimum_jerk(2.0))
    results = judgements[-1].results
    told = [(at, e) for at, j in enumerate(judgements) for e in j.events if "movement" in e.name]
    (known, onset), (_, offset) = told
    assert (onset.name, offset.name) == ("movement.onset", "movement.offset")
    assert onset.time == pytest.approx(results["movement_onset"])
    assert onset.data["delay_s"] == pytest.approx(hold_s, abs=1e-9)
    assert known / RATE_HZ == pytest.approx(onset.time + hold_s)
    assert offset.time - onset.time == pytest.approx(results["movement_time"])
    assert (results["onset_speed"], results["onset_hold"]) == (0.02, hold_s)


def strokes(*parts: tuple[float, float], before: float = 0.5) -> np.ndarray:
    """Fractions of the way: minimum-jerk strokes of a share of it each, a halt behind each."""
    way, made = [np.zeros(round(before * RATE_HZ))], 0.0
    for share, halt in parts:
        way.append(made + share * minimum_jerk(1.0, before=0.0, after=halt))
        made += share
    return np.concatenate(way)


def test_strokes_before_a_halt_are_part_of_the_movement() -> None:
    halting = strokes((0.1, 0.4), (0.2, 0.4), (0.5, 0.4), (0.2, 1.0))
    results = Path().play(halting)[-1].results
    first, last = crossing(0.02 / 0.2), crossing(0.02 / 0.4)
    assert results["movement_onset"] == pytest.approx(0.5 + first, abs=1.5 / RATE_HZ)
    assert results["movement_time"] == pytest.approx(5.2 - first - last, abs=3.5 / RATE_HZ)
    assert results["path_length"] == pytest.approx(2.0, abs=0.01)


def test_a_press_between_two_strokes_ends_a_movement_whose_onset_no_later_stroke_moves() -> None:
    slow_then_fast = strokes((0.02, 0.5), (0.98, 1.0))
    last = Path(end="trigger").play(slow_then_fast, trigger=ticks((3.5, 3.6)))[-1].results
    onset = 0.5 + crossing(0.02 / 0.04)
    assert last["movement_onset"] == pytest.approx(onset, abs=1.5 / RATE_HZ)
    early = Path(end="trigger").play(slow_then_fast, trigger=ticks((1.8, 1.9)))[-1]
    assert early.phase is Phase.SUCCESS
    assert early.results["movement_onset"] == last["movement_onset"]


@pytest.mark.parametrize("held", [0, 60])
def test_the_reaction_is_the_first_command_after_a_tick_without_one(held: int) -> None:
    commands = [*range(held), *range(150, 400)]
    results = Path().play(minimum_jerk(2.0), commands=commands)[-1].results
    assert results["reaction_time"] == pytest.approx(150 / RATE_HZ)
    assert results["command_onset"] == pytest.approx(0.0 if held else 150 / RATE_HZ)
    never = Path().play(minimum_jerk(2.0), commands=range(2000))[-1].results
    assert math.isnan(never["reaction_time"])


def first_motion(fast: np.ndarray, distance: np.ndarray, hold: float, nearer: float) -> int:
    """Return the tick of the first stretch that is long, or at once and towards the target."""
    for first, stop in np.flatnonzero(np.diff(fast, prepend=False, append=False)).reshape(-1, 2):
        if (stop - 1 - first >= hold) if first else (distance[0] - min(distance[:stop]) >= nearer):
            return int(first)
    raise AssertionError("nothing moved")


@pytest.mark.slow
def test_the_task_finds_onset_and_reaction_of_whole_arrays() -> None:
    random = np.random.default_rng(38)
    found = 0
    for _ in range(60):
        steps = random.normal(0.0, 0.004, 20) * (random.random(20) < 0.5)
        way = np.interp(np.linspace(0.0, 20.0, 800), np.arange(20), np.cumsum(steps))
        way += np.cumsum(random.normal(0.0, 2e-5, 800))
        commands = np.flatnonzero(random.random(800) < random.choice([0.0, 0.1, 0.9, 1.0]))
        path = Path(end="trigger", onset_hold_s=float(random.uniform(0.0, 0.2)))
        hold_s = path.task._settings.onset_hold_s
        results = path.play(way, commands=set(commands), trigger={790})[-1].results
        tip = path.start + np.outer(way, path.target - path.start)
        ended = 791
        if not results:
            continue
        fast = np.linalg.norm(np.gradient(tip, 1 / RATE_HZ, axis=0), axis=1)[:ended] > 0.02
        distance = np.linalg.norm(tip - path.target, axis=1)[:ended]
        at = first_motion(fast, distance, RATE_HZ * hold_s - 1e-6, nearer=0.25)
        given = np.isin(np.arange(ended), commands)
        answers = np.flatnonzero(given & np.logical_or.accumulate(~given))
        expected = answers[0] / RATE_HZ if answers.size else np.nan
        assert results["movement_onset"] == pytest.approx(at / RATE_HZ)
        assert results["reaction_time"] == pytest.approx(expected, nan_ok=True)
        found += 1
    assert found > 40


@pytest.mark.parametrize("over", [-0.1, 0.0, 0.1])
def test_the_signed_error_is_positive_beyond_the_centre(over: float) -> None:
    results = Path().play(minimum_jerk(2.0, end=1.0 + over / 2.0))[-1].results
    assert results["error_along"] == pytest.approx(over, abs=5e-4)  # not yet quite at rest
    assert results["error"] == pytest.approx(abs(over), abs=5e-4)
    assert results["error_across"] == pytest.approx(0.0, abs=1e-9)
    assert results["error_bound"] == 0.25


def test_times_from_circle_to_circle_include_what_onset_and_rest_leave_out() -> None:
    seconds, distance, radius = 2.0, 2.0, 0.25
    results = Path().play(minimum_jerk(seconds))[-1].results
    whole = results["movement_onset"] + results["movement_time"]
    assert results["circle_to_circle"] == pytest.approx(whole, rel=1e-12)

    def after(fraction: float) -> float:
        s = np.linspace(0.0, 1.0, 100_001)
        return seconds * float(s[np.searchsorted(10 * s**3 - 15 * s**4 + 6 * s**5, fraction)])

    between = after(1.0 - radius / distance) - after(radius / distance)
    assert results["between_circles"] == pytest.approx(between, abs=2.5 / RATE_HZ)


def test_rest_outside_the_circle_ends_nothing_when_it_must_be_inside() -> None:
    judgements = Path().play(minimum_jerk(2.0, end=0.8))  # 0.4 m short of the centre
    assert not judgements[-1].phase.over


def test_a_crawl_into_the_circle_counts_as_rest_only_from_its_edge() -> None:
    # 0.01 m/s is rest, and 0.3 m before the centre is outside.
    crawl = 0.85 + np.arange(0, 20, 1 / RATE_HZ) * 0.01 / 2.0
    approach = minimum_jerk(2.0, after=0.0, end=0.85)
    last = Path().play(np.concatenate([approach, crawl[crawl < 1.0]]))[-1]
    assert last.phase is Phase.SUCCESS
    assert last.results["error"] == pytest.approx(0.25, abs=1e-3)
    assert last.results["error"] <= last.results["error_bound"]


def test_rest_anywhere_ends_a_movement_once_half_the_way_is_done() -> None:
    short = Path(end="rest_anywhere").play(minimum_jerk(2.0, end=0.8))[-1]
    assert short.phase is Phase.SUCCESS
    assert short.results["error"] == pytest.approx(0.4, abs=1e-3)
    assert math.isnan(short.results["error_bound"])
    hesitant = Path(end="rest_anywhere").play(minimum_jerk(2.0, end=0.4))[-1]
    assert not hesitant.phase.over


def test_the_trigger_ends_a_movement_where_the_tip_is() -> None:
    path = minimum_jerk(2.0)
    pressed = round(2.0 * RATE_HZ)
    judgements = Path(end="trigger").play(path, trigger=range(pressed, pressed + 20))
    assert len(judgements) == pressed + 1
    assert judgements[-1].phase is Phase.SUCCESS


def test_a_trigger_held_from_before_ends_nothing() -> None:
    path = minimum_jerk(2.0)
    assert not Path(end="trigger").play(path, trigger=range(len(path)))[-1].phase.over


@pytest.mark.parametrize("dwell", [0.3, 0.7])
def test_the_time_to_rest_is_that_of_the_rest_rules_whenever_the_tap_comes(dwell: float) -> None:
    seconds = 2.0
    by_rest = Path().play(minimum_jerk(seconds))[-1].results
    assert by_rest["onset_to_rest"] == by_rest["movement_time"]
    assert by_rest["at_rest"] == pytest.approx(0.2, abs=1 / RATE_HZ)
    offset = 0.5 + (1 - crossing(0.02 * seconds / 2.0)) * seconds
    path = minimum_jerk(seconds)
    by_tap = Path(end="trigger").play(path, trigger=ticks((offset + dwell, 3.4)))[-1].results
    assert by_tap["onset_to_rest"] == by_rest["onset_to_rest"]
    assert by_tap["at_rest"] == pytest.approx(dwell, abs=1.5 / RATE_HZ)
    parts = by_tap["movement_onset"] + by_tap["onset_to_rest"] + by_tap["at_rest"]
    assert parts == pytest.approx(by_tap["circle_to_circle"], rel=1e-12)


@pytest.mark.parametrize(("dwell", "at_rest"), [(-0.5, 0.0), (0.1, 0.1)])
def test_a_tap_before_a_rest_is_long_enough_leaves_its_time_open_and_says_why(
    dwell: float, at_rest: float
) -> None:
    offset = 0.5 + (1 - crossing(0.02)) * 2.0
    presses = ticks((offset + dwell, offset + dwell + 0.1))
    last = Path(end="trigger").play(minimum_jerk(2.0), trigger=presses)[-1]
    assert last.phase is Phase.SUCCESS
    assert math.isnan(last.results["onset_to_rest"])
    assert last.results["at_rest"] == pytest.approx(at_rest, abs=1.5 / RATE_HZ)


def test_the_rest_is_the_one_that_the_tap_found_not_one_before_a_correction() -> None:
    path = np.concatenate([0.8 * minimum_jerk(2.0), 0.8 + 0.2 * minimum_jerk(1.0, before=0.0)])
    last = Path(end="trigger").play(path, trigger=ticks((5.0, 5.1)))[-1]
    corrected = 3.5 + (1 - crossing(0.02 * 1.0 / 0.4)) * 1.0
    began = last.results["movement_onset"]
    assert last.results["onset_to_rest"] == pytest.approx(corrected - began, abs=2.5 / RATE_HZ)


def ignored(judgements) -> list[tuple[float, object]]:
    """Return when presses were ignored, and before what."""
    events = [event for each in judgements for event in each.events]
    return [(e.time, e.data["before"]) for e in events if e.name == "tap.ignored"]


def ticks(*presses: tuple[float, float]) -> set[int]:
    """Return the ticks of presses that last from one time in s to another."""
    return {
        tick
        for start, end in presses
        for tick in range(round(start * RATE_HZ), round(end * RATE_HZ))
    }


def test_presses_at_random_before_the_onset_are_all_told_and_none_ends_a_movement() -> None:
    random = np.random.default_rng(20)
    for _ in range(20):
        starts = 0.01 + np.cumsum(random.uniform(0.02, 0.1, random.integers(1, 6)))
        presses = [(start, start + 0.01) for start in starts]
        path = minimum_jerk(random.uniform(1.5, 3.0), before=0.7)
        judgements = Path(end="trigger").play(path, trigger=ticks(*presses, (4.0, 4.1)))
        seen, before = zip(*ignored(judgements), strict=True)
        assert set(before) == {"movement.onset"}
        np.testing.assert_allclose(seen, starts, atol=1 / RATE_HZ)
        assert judgements[-1].phase.over == (len(path) > 4.0 * RATE_HZ)


def running_out(seconds: float, speed: float) -> np.ndarray:
    """Fractions of a way of 2 m while the tip, slowing down, goes on beyond where it starts."""
    t = np.arange(0, seconds, 1 / RATE_HZ)
    return -speed * (t - t**2 / (2 * seconds)) / 2.0


def test_a_bounce_while_the_last_movement_runs_out_ends_nothing() -> None:
    out = running_out(0.5, 0.5)
    way = out[-1] + (1.0 - out[-1]) * minimum_jerk(2.0, before=0.2)
    presses = ticks((0.2, 0.3), (3.2, 3.3))
    judgements = Path(end="trigger").play(np.concatenate([out, way]), trigger=presses)
    assert [time for time, _ in ignored(judgements)] == [pytest.approx(0.2)]
    assert len(judgements) - 1 == round(3.2 * RATE_HZ)
    assert judgements[-1].results["error"] < 0.01


def test_a_movement_slower_than_the_last_ones_short_end_has_an_onset() -> None:
    out = running_out(0.06, 3.0)  # faster than all that follows, and shorter than an onset
    way = out[-1] + (1.0 - out[-1]) * minimum_jerk(3.0)
    last = Path(end="trigger").play(np.concatenate([out, way]), trigger=ticks((4.0, 4.1)))[-1]
    assert last.phase is Phase.SUCCESS
    peak = minimum_jerk_speed(0.5) * 2.0 / 3.0
    assert last.results["peak_speed"] > peak
    assert 0.55 < last.results["movement_onset"] < 1.0


def test_who_is_in_the_circle_already_may_tap_without_a_movement_and_has_no_times() -> None:
    path = np.ones(round(2 * RATE_HZ))  # a trial that is repeated begins where it ended
    judgements = Path(end="trigger").play(path, trigger=ticks((0.05, 0.1), (1.0, 1.1)))
    assert [time for time, _ in ignored(judgements)] == [pytest.approx(0.05)]
    last = judgements[-1]
    assert last.phase is Phase.SUCCESS
    assert len(judgements) - 1 == RATE_HZ
    for name in ("movement_onset", "movement_time", "circle_to_circle"):
        assert math.isnan(last.results[name])


def test_rest_anywhere_waits_for_a_movement_unless_the_tip_is_in_the_circle() -> None:
    stands = np.full(round(1.5 * RATE_HZ), 0.7)  # 0.6 m before the centre
    assert not Path(end="rest_anywhere").play(stands)[-1].phase.over
    goes = np.concatenate([stands, 0.7 + 0.2 * minimum_jerk(1.0)])
    last = Path(end="rest_anywhere").play(goes)[-1]
    assert last.phase is Phase.SUCCESS
    assert last.results["movement_onset"] > 1.5
    assert Path(end="rest_anywhere").play(np.ones(100))[-1].phase is Phase.SUCCESS


def test_a_time_out_is_an_outcome_of_its_own_with_its_error_and_no_movement_time() -> None:
    last = Path(limit_s=1.5).play(minimum_jerk(4.0))[-1]
    assert last.phase is Phase.TIMEOUT
    assert last.results["error"] > 1.0
    for name in ("movement_time", "onset_to_rest", "between_circles", "circle_to_circle"):
        assert math.isnan(last.results[name])


def test_entries_are_counted_and_the_first_is_an_event() -> None:
    through = np.concatenate(
        [minimum_jerk(2.0, after=0.0, end=1.3), np.linspace(1.3, 1.0, 240), np.ones(240)]
    )
    judgements = Path().play(through)
    assert judgements[-1].results["entries"] == 2
    entered = [e for j in judgements for e in j.events if e.name == "target.entered"]
    assert len(entered) == 1
    assert entered[0].time == pytest.approx(judgements[-1].results["first_entry"])


def test_the_first_command_is_an_event() -> None:
    judgements = Path().play(minimum_jerk(2.0), commands=range(100, 400))
    (event,) = (e for j in judgements for e in j.events if e.name == "command.onset")
    assert event.time == pytest.approx(100 / RATE_HZ)
    assert judgements[-1].results["command_onset"] == pytest.approx(100 / RATE_HZ)


def test_a_twitch_is_no_onset() -> None:
    twitch = np.concatenate([np.zeros(100), np.linspace(0, 0.01, 10), np.full(1000, 0.01)])
    last = Path(limit_s=2.0).play(twitch)[-1]
    assert math.isnan(last.results["movement_onset"])
    assert math.isnan(last.results["circle_to_circle"])


def test_a_record_may_have_the_share_of_a_former_rule_and_a_new_protocol_may_not() -> None:
    written = {"onset_share": 0.05, "onset_speed": 0.03}
    recorded = AimingSettings.model_validate(written, context={"recorded": True})
    assert recorded == AimingSettings(onset_speed=0.03)
    with pytest.raises(ValueError, match="onset_share"):
        AimingSettings.model_validate(written)
