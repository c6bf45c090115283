"""my_part keeps the contract of its role; add what else it promises."""

import pytest
from my_module import MyPart, MyPartSettings

from labcrane import Task
from labcrane.core import Phase
from labcrane.testing import TaskContract, ch8, make_frame, make_run, make_trial, opened


class TestMyPart(TaskContract):
    @pytest.fixture
    def task(self) -> Task:
        return MyPart(MyPartSettings())


def test_a_tip_inside_the_target_ends_the_trial() -> None:
    task = MyPart(MyPartSettings(heights=(1.0,), radius=0.2))
    run = make_run(ch8(), task=task.signals)
    with opened(task, run):
        (planned,) = task.plan(task.factors())
        task.begin_trial(make_trial(planned))
        frame = make_frame(run)
        for height, phase in ((1.3, Phase.RUNNING), (1.1, Phase.SUCCESS)):
            frame.state[run.state.find("tip.position")] = (5.0, 0.0, height)
            assert task.evaluate(frame).phase is phase
