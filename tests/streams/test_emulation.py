"""The emulated clock itself: what it reads, and when its deadlines are due, in closed form."""

import math
import os
import subprocess
import sys
import time

import numpy as np
import pytest
from needs import need
from streams.emulation import build

NOW = 100.0
STEP_AT = 150.0


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    need("gcc")
    return build(tmp_path_factory.mktemp("skew"))


def asked(library, code, **settings):
    """Return what a process with a skewed clock prints."""
    skew = {f"SKEW_{name.upper()}": f"{value:.9f}" for name, value in settings.items()}
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "LD_PRELOAD": str(library), **skew},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return [float(word) for word in done.stdout.split()]


def dues(library, readings, now, **settings):
    code = (
        "import ctypes\n"
        "due = ctypes.CDLL(None).skew_due\n"
        "due.restype, due.argtypes = ctypes.c_double, [ctypes.c_double] * 2\n"
        f"for reading in {list(map(float, readings))}: print(repr(due(reading, {now})))"
    )
    return asked(library, code, offset=1000.0, ref=100.0, step_at=STEP_AT, **settings)


@pytest.mark.parametrize("step", [-7.0, -0.3, 0.0, 0.3, 7.0])
def test_a_deadline_is_due_when_the_clock_first_reads_it(library, step):
    random = np.random.default_rng([5, int(10 * step) % 97])
    readings = random.uniform(1110.0, 1190.0, 40)
    before = readings - 1000.0  # t + 1000 until the step
    after = before - step
    expected = np.where(before < STEP_AT, before, np.maximum(after, STEP_AT))
    assert dues(library, readings, NOW, step=step) == pytest.approx(expected, abs=1e-6)
    later = dues(library, readings, STEP_AT + 20.0, step=step)
    assert later == pytest.approx(after, abs=1e-6)  # what a step back lets come twice came once


def test_a_drifting_wandering_slewed_clock_is_mapped_both_ways(library):
    random = np.random.default_rng(6)
    times = random.uniform(101.0, 300.0, 40)
    settings = {"ppm": 300.0, "wander": 0.004, "period": 37.0}
    settings |= {"slew": 4e-3, "slew_at": 180.0, "slew_s": 20.0}
    readings = [
        t + 1000.0 + 3e-4 * (t - 100.0) + 0.004 * math.sin(2 * math.pi * (t - 100.0) / 37.0)
        + 4e-3 * min(max(t - 180.0, 0.0), 20.0)
        for t in times
    ]  # fmt: skip
    assert dues(library, readings, NOW, **settings) == pytest.approx(times, abs=1e-6)


SLEEP = """
import ctypes, time
from ctypes import c_long
class Spec(ctypes.Structure):
    _fields_ = (("s", c_long), ("ns", c_long))
libc = ctypes.CDLL(None)
def true():
    now = Spec()
    libc.syscall(c_long(228), c_long(1), ctypes.byref(now))
    return now.s + 1e-9 * now.ns
begin, until = true(), time.monotonic() + 0.1
spec = Spec(int(until), int((until - int(until)) * 1e9))
libc.clock_nanosleep(1, 1, ctypes.byref(spec), None)
print(true() - begin)
"""


@pytest.mark.parametrize("step", [-2.0, 2.0])
def test_sleep_takes_as_long_as_it_should_after_a_step(library, step):
    past = time.perf_counter() - 1.0
    (took,) = asked(library, SLEEP, offset=1000.0, ref=past, step=step, step_at=past)
    assert took >= 0.0999
