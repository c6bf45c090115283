"""The contract of tasks."""

from collections.abc import Mapping, Sequence

import numpy as np

from labcrane.core.records import Frame, Phase, Run
from labcrane.core.roles import Task
from labcrane.core.signals import Signal
from labcrane.testing.components import check_closes_after_failed_open, check_soon
from labcrane.testing.roles import (
    RATE_HZ,
    ch8,
    check_array,
    check_signals,
    crane_at,
    crane_state,
    make_frame,
    make_run,
    make_trial,
    opened,
)


class TaskContract:
    """What every task must do. Provide the fixture ``task``.

    Name in ``needs`` what the task needs of the machine's state beyond that of every crane; the
    stand-in has zeros there.
    """

    needs: Sequence[Signal] = ()

    def _run(self, task: Task) -> Run:
        state = (*crane_state(ch8()).signals, *self.needs)
        return make_run(ch8(), state=state, task=task.signals)

    def _frame(self, run: Run, number: int = 0) -> Frame:
        crane = crane_at(run.machine, run.machine.rest)
        return make_frame(run, number, np.pad(crane, (0, run.state.size - crane.size)))

    def test_a_plan_follows_the_order_of_its_levels(self, task: Task) -> None:
        factors = task.factors()
        forward = task.plan(factors)
        backward = task.plan({name: list(levels)[::-1] for name, levels in factors.items()})
        again = task.plan(factors)
        assert [p.condition for p in forward] == [p.condition for p in again], (
            "plan() must return the same for the same levels"
        )
        assert len(forward) == len(backward), "the order of levels changes how many there are"
        assert any(planned.counted for planned in forward), "one planned trial at least must count"
        assert all(planned.expected_s > 0 for planned in forward), "expected_s must be over 0"

    def test_task_judges_what_its_signals_promise(self, task: Task) -> None:
        check_signals(task)
        run = self._run(task)
        with opened(task, run):
            for planned in task.plan(task.factors())[:3]:
                task.begin_trial(make_trial(planned))
                judgement = task.evaluate(self._frame(run))
                check_array(task, judgement.values)
                assert judgement.phase is not Phase.IDLE, "a trial that has begun is not IDLE"

    def test_the_same_frames_are_judged_alike_after_every_beginning(self, task: Task) -> None:
        run = self._run(task)
        with opened(task, run):
            planned = task.plan(task.factors())[0]
            judged = []
            for _ in range(2):
                task.begin_trial(make_trial(planned, seed=7))
                seen = [task.evaluate(self._frame(run, number)) for number in range(20)]
                judged.append([(each.phase, each.values.tolist(), each.events) for each in seen])
            np.testing.assert_equal(judged[0], judged[1])

    def test_task_judges_at_once(self, task: Task) -> None:
        run = self._run(task)
        frame = self._frame(run)
        with opened(task, run):
            task.begin_trial(make_trial(task.plan(task.factors())[0]))
            check_soon(lambda: task.evaluate(frame))

    def test_task_closes_after_a_failed_open(self, task: Task) -> None:
        check_closes_after_failed_open(task)

    def test_an_overruled_trial_has_no_automatic_end(self, task: Task) -> None:
        run = self._run(task)
        with opened(task, run):
            for planned in task.plan(task.factors())[:2]:
                task.begin_trial(make_trial(planned))
                task.lift_limits()
                late = self._frame(run, number=int(3600 * RATE_HZ))
                over = task.evaluate(late).phase.over
                assert not over, "after lift_limits() a trial must not end by itself"

    def test_results_have_a_definition(self, task: Task) -> None:
        bare = [signal.name for signal in task.results if not signal.definition]
        assert not bare, (
            f"the results {', '.join(bare)} have no definition; say what each is, in "
            "Signal(name, unit, definition=...): the codebook and the report print it"
        )

    def test_results_are_declared(self, task: Task) -> None:
        run = self._run(task)
        declared = {column for signal in task.results for column in signal.columns}
        with opened(task, run):
            for planned in task.plan(task.factors())[:3]:
                task.begin_trial(make_trial(planned))
                results: Mapping[str, object] = {}
                for number in range(int(120 * RATE_HZ)):
                    judgement = task.evaluate(self._frame(run, number))
                    if judgement.phase.over:
                        results = judgement.results
                        break
                assert set(results) == declared, "a machine that never moves must end by a limit"
