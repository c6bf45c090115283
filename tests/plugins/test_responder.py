"""The simulated operator's responses to a secondary task: their delay, and what load does."""

import numpy as np
import pytest

from labcrane import Signal, Tick
from labcrane.testing import ch8, make_frame, make_run
from labcrane_operator.responder import Responder
from labcrane_operator.settings import ResponseSettings

RUN = make_run(ch8(), task=(Signal("drt.stimulus", "1"),))


def delays(deflection: float, count: int = 1, **settings: float) -> list[float]:
    """Return the response times to stimuli that come every three seconds; NaN for a miss."""
    made = ResponseSettings.model_validate({"to": "drt.stimulus", **settings})
    responder = Responder(made, 0, [0, 1], RUN.rate_hz)
    responder.begin_trial(1)
    frame, found, every = make_frame(RUN), [], round(3 * RUN.rate_hz)
    frame.axes[:2] = deflection
    for onset in range(0, count * every, every):
        pressed = []
        for tick in range(onset, onset + every):
            frame.tick = Tick(tick, 0.0, 0.0)
            frame.task = np.array([float(tick - onset < RUN.rate_hz)])
            if responder.pressing(frame):  # in the tick after the one that was seen
                pressed.append(tick + 1)
        found.append((pressed[0] - onset) / RUN.rate_hz if pressed else np.nan)
    return found


def test_without_spread_or_load_the_delay_is_the_median() -> None:
    assert delays(0.5, sd=0, load=0, lapse_rate=0, median_s=0.25) == [0.25]


def test_deflected_hands_respond_later_by_the_share_that_was_asked_for() -> None:
    (late,) = delays(0.5, sd=0, load=1.0, lapse_rate=0, median_s=0.4)
    assert late == pytest.approx(0.6, abs=1 / RUN.rate_hz)


@pytest.mark.slow
def test_deflected_hands_miss_more_often() -> None:
    rest, loaded = (np.isnan(delays(at, 400, lapse_rate=0.2, load=1.0)).mean() for at in (0.0, 1.0))
    assert rest == pytest.approx(0.2, abs=0.06)  # three standard errors
    assert loaded == pytest.approx(0.4, abs=0.075)
