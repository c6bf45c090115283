"""The contract of secondary tasks."""

from collections.abc import Iterator, Mapping

import numpy as np
import pytest

from labcrane.core.clock import Tick
from labcrane.core.records import Frame, Run, TrialStatus
from labcrane.core.roles import SecondaryTask
from labcrane.core.signals import Layout
from labcrane.testing.components import check_closes_after_failed_open, check_soon
from labcrane.testing.roles import (
    RATE_HZ,
    STICKS,
    ch8,
    check_signals,
    make_frame,
    make_run,
    make_trial,
    opened,
)


class SecondaryTaskContract:
    """What every secondary task must do. Provide the fixture ``secondary``.

    The stand-in for the input has the axes ``left.x``, ``left.y``, ``left.trigger``, and the same
    of ``right``.
    """

    @pytest.fixture
    def secondary(self) -> SecondaryTask:
        raise NotImplementedError

    def _run(self) -> Run:
        return make_run(ch8(), axes=STICKS)

    def _frames(self, run: Run, begin: int = 0) -> Iterator[Frame]:
        """Yield 20 s of a trial with moving controls; the same arrays each time."""
        frame = make_frame(run)
        for number in range(round(20 * RATE_HZ)):
            due = number / RATE_HZ
            frame.tick, frame.elapsed = Tick(begin + number, due, due), due
            random = np.random.default_rng(number // 60)
            frame.axes[:] = random.uniform(-1.0, 1.0, run.axes.size)
            yield frame

    def _trial(self, secondary: SecondaryTask, run: Run) -> list[TrialStatus]:
        """Return its status in 20 s of a trial with moving controls."""
        secondary.begin_trial(make_trial(seed=7))
        return [secondary.evaluate(frame) for frame in self._frames(run)]

    def test_its_values_are_what_its_signals_promise(self, secondary: SecondaryTask) -> None:
        check_signals(secondary)
        size = Layout("secondary", secondary.signals).size
        run = self._run()
        with opened(secondary, run):
            for status in self._trial(secondary, run):
                assert status.values.shape == (size,), (
                    f"its signals promise shape ({size},), got {status.values.shape}"
                )

    def test_its_measures_are_declared_and_defined(self, secondary: SecondaryTask) -> None:
        bare = [signal.name for signal in secondary.results if not signal.definition]
        assert not bare, f"the results {', '.join(bare)} have no definition; say what each is"
        run = self._run()
        with opened(secondary, run):
            self._trial(secondary, run)
            measured: Mapping[str, object] = secondary.measure()
        declared = {column for signal in secondary.results for column in signal.columns}
        assert set(measured) == declared, (
            f"measure() returned {', '.join(measured)}, and its results are {', '.join(declared)}; "
            "return every one of them, None where there is no value"
        )

    def test_the_seed_of_a_trial_decides_all_that_is_random(self, secondary: SecondaryTask) -> None:
        """After an interruption, the same trial with the same controls is the same again."""
        run, seen = self._run(), []
        with opened(secondary, run):
            for begin in (0, 100_000):
                secondary.begin_trial(make_trial(seed=7))
                frames = self._frames(run, begin)
                seen.append([secondary.evaluate(frame).values.copy() for frame in frames])
        np.testing.assert_array_equal(seen[0], seen[1])

    def test_it_evaluates_at_once(self, secondary: SecondaryTask) -> None:
        run = self._run()
        frame = make_frame(run)
        with opened(secondary, run):
            secondary.begin_trial(make_trial())
            check_soon(lambda: secondary.evaluate(frame))

    def test_it_closes_after_a_failed_open(self, secondary: SecondaryTask) -> None:
        check_closes_after_failed_open(secondary)
