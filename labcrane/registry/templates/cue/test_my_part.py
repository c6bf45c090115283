"""my_part keeps the contract of its role; add what else it promises."""

import math

import pytest
from my_module import MyPart, MyPartSettings

from labcrane import Cue
from labcrane.core import Cylinder
from labcrane.testing import TARGETS, CueContract, ch8, make_run, make_target, opened


class TestMyPart(CueContract):
    @pytest.fixture
    def cue(self) -> Cue:
        return MyPart(MyPartSettings())


def test_the_line_ends_at_tip_and_target() -> None:
    run = make_run(ch8(), task=TARGETS)
    cue = MyPart(MyPartSettings())
    with opened(cue, run):
        frame = make_target(run)
        (line,) = cue.draw(frame)
        assert isinstance(line, Cylinder)
        assert line.end == tuple(frame.task[run.task.find("target.position")])
        assert math.dist(line.start, line.end) == pytest.approx(cue.values(frame)[0])
