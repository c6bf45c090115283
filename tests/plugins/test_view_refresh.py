"""Refresh of the screen: whether pictures wait for it, what was missed, what the record says."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from windows import a_view, an_x_server, make_frame

from labcrane_view.screen.refresh import MEASURED, WARM, Refresh, measured, waited

RATES = (50.0, 59.94, 60.0, 75.0, 120.0, 144.0, 240.0)
SEED = int(np.random.SeedSequence().generate_state(1)[0])


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(SEED)


def test_pictures_that_wait_are_known_by_whole_refreshes_however_long_one_takes(
    random: np.random.Generator,
) -> None:
    for _ in range(200):
        rate = float(random.choice(RATES))
        turns = random.integers(1, random.integers(2, 5), MEASURED)
        intervals = (turns + random.normal(0.0, 0.02, MEASURED)) / rate
        intervals[random.integers(MEASURED)] += 0.4 / rate  # the program was held up once
        assert waited(intervals.tolist(), rate) is True, f"seed {SEED}"


def test_pictures_that_do_not_wait_are_known_whatever_they_take(
    random: np.random.Generator,
) -> None:
    """Not only faster than the monitor: slow ones come at any part of a refresh."""
    for _ in range(200):
        rate = float(random.choice(RATES))
        least = random.uniform(0.05, 3.0)
        intervals = random.uniform(least, least + 1.5, MEASURED) / rate
        assert waited(intervals.tolist(), rate) is False, f"seed {SEED}"


def test_of_a_virtual_screen_nothing_is_claimed() -> None:
    assert waited([0.016] * MEASURED, math.nan) is None
    drawn: list[int] = []
    found = measured(lambda: drawn.append(1), math.nan, buffers=2)
    assert (drawn, found.waits, math.isnan(found.missed(0.1))) == ([], None, True)
    said = {"refresh_hz": "not known", "buffers": 2}
    assert found.facts() == said | {"tearing": "not known: the monitor's refresh rate is not"}


def test_the_swap_is_measured_once_it_is_steady() -> None:
    def clock() -> Iterator[float]:
        now = 0.0
        while True:
            yield now
            now += 1.0 / 60.0

    drawn: list[int] = []
    ticks = clock()
    found = measured(lambda: drawn.append(1), 60.0, 2, lambda: next(ticks))
    assert len(drawn) == WARM + MEASURED
    assert found == Refresh(60.0, waits=True, buffers=2)
    assert found.facts()["tearing"] == "not possible: pictures wait for the refresh"


@pytest.mark.parametrize(
    ("refreshes", "missed"), [(0.97, 0), (1.02, 0), (2.05, 1), (4.9, 4), (0.02, 0)]
)
def test_a_missed_refresh_is_one_that_showed_the_picture_before_again(
    refreshes: float, missed: int
) -> None:
    assert Refresh(144.0, waits=True).missed(refreshes / 144.0) == missed
    assert math.isnan(Refresh(144.0, waits=False).missed(refreshes / 144.0))


def test_one_buffer_is_said_to_show_half_drawn_pictures() -> None:
    said = Refresh(60.0, waits=True, buffers=1).tearing
    assert said == "possible, and half-drawn pictures too: there is one buffer"
    assert Refresh(60.0, waits=False, buffers=2).tearing == "possible"


@pytest.mark.parametrize("renderer", ["auto", "software"])
def test_a_real_window_has_two_buffers_and_says_what_is_not_known(
    renderer: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with an_x_server() as display:
        monkeypatch.setenv("DISPLAY", display)
        with a_view(display="window", size=(320, 180), renderer=renderer) as view:
            view.present(make_frame())
            row = dict(
                zip([each.name for each in view.signals], view.present(make_frame(1)), strict=True)
            )
            facts = view.metadata()
    assert facts["buffers"] == 2
    assert facts["refresh_hz"] == "not known"
    assert "not known" in str(facts["tearing"])
    assert math.isnan(row["refresh.missed"])
