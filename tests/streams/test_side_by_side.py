"""Two sessions at once, of studies of one name and people of one pseudonym, on one network."""

import time
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
from rehearsal import a_study

from labcrane import Tick
from labcrane.machines import load_machine
from labcrane.streams import NewestSample
from labcrane.streams.outlets import STATE, Outlets, source_id
from labcrane.testing import Visit, make_frame, make_run


def test_streams_of_two_sessions_of_one_name_do_not_mix(tmp_path: Path) -> None:
    """One file held 151 of 294 samples of the other session's view."""
    visits = []
    for laboratory in ("here", "there"):
        (tmp_path / laboratory).mkdir()
        study = a_study(tmp_path / laboratory)
        visits.append(Visit(study, "P001", 1, tmp_path / laboratory / "data"))
    first, second = (visit.source for visit in visits)
    assert first != second
    assert first.rpartition("/")[0] == second.rpartition("/")[0]
    run = make_run(load_machine("ch8"))
    with ExitStack() as stack:
        outlets = [stack.enter_context(closing(Outlets(run, one))) for one in (first, second)]
        heard = [
            stack.enter_context(closing(NewestSample({"source_id": source_id(one, STATE)})))
            for one in (first, second)
        ]
        found: list[set[float]] = [set(), set()]
        number, deadline = 0, time.monotonic() + 60.0
        while not all(len(one) > 0 for one in found) or number < 200:
            assert time.monotonic() < deadline
            for value, each in enumerate(outlets):
                frame = make_frame(run, state=np.full(run.state.size, float(value)))
                frame.tick = Tick(number, time.perf_counter(), 0.0)
                each.push(frame)
            number += 1
            for values, each in zip(found, heard, strict=True):
                values |= {float(sample[0]) for sample in each.pull()[0]}
            time.sleep(0.005)  # liblsl needs a while to connect
    assert found == [{0.0}, {1.0}]


def test_a_session_that_is_resumed_has_the_streams_that_it_had(tmp_path: Path) -> None:
    study = a_study(tmp_path)
    visit = Visit(study, "P001", 1, tmp_path / "data")
    again = Visit(study, "P001", 1, tmp_path / "data", resumed=True)
    assert visit.source == again.source
    assert Visit(study, "P001", 2, tmp_path / "data").source != visit.source
