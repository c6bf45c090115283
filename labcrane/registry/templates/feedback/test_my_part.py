"""my_part keeps the contract of its role; add what else it promises."""

import pytest
from my_module import MyPart, MyPartSettings

from labcrane import Feedback
from labcrane.testing import (
    TARGETS,
    FeedbackContract,
    ch8,
    make_frame,
    make_run,
    make_target,
    opened,
)


class TestMyPart(FeedbackContract):
    @pytest.fixture
    def feedback(self) -> Feedback:
        return MyPart(MyPartSettings())


def test_it_is_dark_without_a_target_and_brightest_at_it() -> None:
    run = make_run(ch8(), task=TARGETS)
    lamp = MyPart(MyPartSettings())
    with opened(lamp, run):
        there = make_target(run)
        there.state[run.state.find("tip.position")] = there.task[run.task.find("target.position")]
        assert lamp.present(make_frame(run)) == [0.0]
        assert lamp.present(there) == [1.0]
