"""Work on several cores by default: how many processes, and that results stay the same."""

import math
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from labcrane.analysis.parallel import SHARE, usual_workers, work


@given(orders=st.integers(0, 500), cores=st.integers(1, 64))
def test_every_core_works_as_soon_as_each_worker_has_enough(orders: int, cores: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "sched_getaffinity", lambda _: set(range(cores)), raising=False)
        workers = usual_workers(orders)
    assert 1 <= workers <= cores
    assert workers == 1 or orders >= workers * SHARE
    if orders >= cores * SHARE:
        assert workers == cores
    # One more would have less than its share, or no core.
    assert workers == cores or orders < (workers + 1) * SHARE


def test_two_workers_give_what_one_gives() -> None:
    numbers = list(range(2 * SHARE))
    assert sorted(work(math.factorial, numbers, 2)) == list(work(math.factorial, numbers))
