"""Loop-back checks: a sensor's channel beside the changes that it was to see, made by formula."""

import re

import numpy as np
import pytest

from labcrane.core import Verdict
from labcrane.streams.edges import Change
from labcrane.streams.sync.report.loop_back import judge_loop_back

NAMES = "Amplifier", "Diode", "operator"


def a_screen(random, count):
    """Return times at which a square changed: irregular, as trials are."""
    return 1000.0 + np.cumsum(random.uniform(0.5, 8.0, count))


def a_diode(random, seen, rate, slow_s):
    """Return times and values of an amplifier's channel: either sign, noisy, with slow drifts."""
    times = seen[0] - 2.0 + np.arange(int((seen[-1] - seen[0] + 4.0) * rate)) / rate
    since = np.searchsorted(seen, times, side="right")
    level = (since % 2).astype(float)
    # A high pass of the amplifier lets every step fade.
    last = np.r_[-np.inf, seen][since]
    level += np.where(since % 2, -0.5, 0.5) * (1.0 - np.exp(-(times - last) / slow_s))
    gain = random.choice((-1.0, 1.0)) * 10.0 ** random.uniform(-5, 2)
    values = gain * (level + 0.02 * random.normal(size=len(times)))
    return times, values + gain * random.uniform(-3, 3) * np.sin(times / 50.0)


@pytest.mark.parametrize("seed", range(12))
def test_a_steady_delay_is_measured_and_passes(seed):
    random = np.random.default_rng([1, seed])
    rate, late = random.uniform(250.0, 2000.0), random.uniform(0.0, 0.1)
    shown = a_screen(random, 80)
    times, values = a_diode(random, shown + late, rate, slow_s=random.uniform(2.0, 10.0))
    stated = random.uniform(1e-4, 2e-3)
    times += random.uniform(-stated, stated) / 2.0
    found = judge_loop_back(NAMES, changes(shown), (times, values), stated, light=True)
    assert found.verdict is Verdict.PASS, found.findings
    assert (found.delay.seen, found.delay.asked) == (80, 80)
    # A step lies anywhere between two samples, and is found halfway.
    assert abs(found.delay.mean_s - late) < stated / 2.0 + 1.0 / rate / np.sqrt(12 * 80) * 4
    assert abs(found.moved_s) < 1.0 / rate


@pytest.mark.parametrize("seed", range(12))
def test_times_that_leave_what_is_stated_fail(seed):
    """The clock is a little faster, or steps at some time in the middle third."""
    random = np.random.default_rng([2, seed])
    rate, stated = random.uniform(500.0, 2000.0), random.uniform(1e-4, 1e-3)
    shown = a_screen(random, 90)
    times, values = a_diode(random, shown + 0.03, rate, slow_s=5.0)
    share = (times - times[0]) / (times[-1] - times[0])
    wrong = random.choice((-1.0, 1.0)) * random.uniform(5.0, 10.0) * (stated + 1.0 / rate)
    off = wrong * share if seed % 2 else wrong * (share > random.uniform(0.4, 0.6))
    found = judge_loop_back(NAMES, changes(shown), (times + off, values), stated, light=True)
    assert found.verdict is Verdict.FAIL
    expected = wrong * (2.0 / 3.0 if seed % 2 else 1.0)
    assert found.moved_s == pytest.approx(expected, abs=2.0 / rate + abs(wrong) / 8.0)
    assert "first third of the session to the last" in found.findings[0].text


def test_light_before_its_picture_fails():
    random = np.random.default_rng(3)
    shown = a_screen(random, 40)
    signal = a_diode(random, shown - 0.008, 1000.0, slow_s=5.0)
    found = judge_loop_back(NAMES, changes(shown), signal, 1e-3, light=True)
    assert found.verdict is Verdict.FAIL
    assert "Diode shows operator 8." in found.findings[0].text
    assert "latency_s" in found.findings[0].advice


@pytest.mark.parametrize("of", ["noise", "another time", "nothing"])
def test_a_sensor_that_sees_nothing_fails_by_name(of):
    random = np.random.default_rng(4)
    shown = a_screen(random, 40)
    times, values = a_diode(random, shown + (3.3 if of == "another time" else 0.0), 500.0, 5.0)
    if of != "another time":
        values = random.normal(size=len(times)) * (of == "noise")
    found = judge_loop_back(NAMES, changes(shown), (times, values), 1e-3, light=True)
    assert found.verdict is Verdict.FAIL
    assert re.search(r"saw \d+ of (39|40) changes", found.findings[0].text)
    assert found.in_words() == "Diode does not show operator"


def test_a_device_that_was_recorded_for_a_while_is_judged_by_that_while():
    random = np.random.default_rng(6)
    shown = a_screen(random, 60)
    times, values = a_diode(random, shown + 0.02, 500.0, slow_s=5.0)
    part = slice(len(times) // 4, len(times) // 2)
    found = judge_loop_back(NAMES, changes(shown), (times[part], values[part]), 1e-3, light=True)
    assert found.verdict is Verdict.PASS
    assert 10 < found.delay.asked < 20


def test_a_screen_that_never_changes_is_a_warning():
    times = np.arange(0.0, 5.0, 0.002)
    found = judge_loop_back(NAMES, [], (times, np.zeros(len(times))), 1e-3, light=True)
    assert found.verdict is Verdict.WARN
    assert "operator did not change while Diode was recorded" in found.findings[0].text


def test_sounds_are_heard_where_they_begin():
    random = np.random.default_rng(5)
    began = a_screen(random, 40)
    times = np.arange(began[0] - 1.0, began[-1] + 1.0, 1 / 4000)
    last = np.r_[-np.inf, began + 0.021][np.searchsorted(began + 0.021, times, side="right")]
    values = np.where(times - last < 0.2, np.sin(2 * np.pi * 440 * times), 0.0)
    values += random.normal(0.0, 0.01, len(times))
    heard = [Change(float(at), up=True) for at in began]
    found = judge_loop_back(NAMES, heard, (times, values), 1e-3, light=False)
    assert found.verdict is Verdict.PASS
    assert found.delay.mean_s == pytest.approx(0.021, abs=1e-3)


def changes(shown):
    return [Change(float(at), up=k % 2 == 0) for k, at in enumerate(shown)]


@pytest.mark.parametrize("late", [0.3, 0.6, 0.7, 1.2])
@pytest.mark.parametrize("least", [0.3, 0.5, 0.9])
def test_a_delay_longer_than_between_changes_is_never_stated_wrongly(late, least):
    """A film 700 ms late was measured as 182 ms late, and passed."""
    random = np.random.default_rng([8, int(10 * late), int(10 * least)])
    shown = 1000.0 + np.cumsum(random.uniform(least, 1.4 * least, 60))
    times = np.arange(shown[0] - 5.0, shown[-1] + 5.0, 1.0 / 30.0)
    bright = np.searchsorted(shown + late, times) % 2
    changes = [Change(at, k % 2 == 0) for k, at in enumerate(shown)]
    names = ("film", "brightness", "view")
    found = judge_loop_back(names, changes, (times, bright + 0.0), 0.002, light=True, upright=True)
    if found.verdict is Verdict.PASS:
        assert found.delay.mean_s == pytest.approx(late, abs=0.02)
