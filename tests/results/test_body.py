"""Heart rate and pupil of a movement, against means of what was sent."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from labcrane.analysis.tables.body import BodySignals


def a_stream(time: np.ndarray, **channels: np.ndarray) -> Any:
    described = [SimpleNamespace(label=label, type="", unit="") for label in channels]
    return SimpleNamespace(
        time=time, header=SimpleNamespace(channels=described), column=channels.__getitem__
    )


def a_session(*streams: Any) -> Any:
    return SimpleNamespace(streams=dict(enumerate(streams)))


def test_heart_rate_and_pupil_are_means_from_onset_to_offset_without_blinks_and_pauses() -> None:
    random = np.random.default_rng(1)
    beats, looks = np.arange(0.0, 60.0), np.arange(0.0, 60.0, 0.01)
    heart = random.uniform(60.0, 90.0, len(beats))
    left, right = random.uniform(2.0, 5.0, (2, len(looks)))
    left[1000:1100], right[1050:1200] = 0.0, np.nan  # a blink of each eye
    gaze = a_stream(looks, left_pupil_diameter=left, right_pupil_diameter=right)
    body = BodySignals(a_session(gaze, a_stream(beats, HR=heart), SimpleNamespace(header=None)))
    found = body.measures(8.0, 20.0, [(12.0, 15.0)])
    own = [k for k in range(61) if 8 <= k <= 20 and not 12 <= k < 15]
    assert found["heart_rate"] == pytest.approx(np.mean([heart[k] for k in own]))
    sizes = []
    for k, at in enumerate(looks):
        seen = [size for size in (left[k], right[k]) if size > 0.0]
        if 8.0 <= at <= 20.0 and not 12.0 <= at < 15.0 and seen:
            sizes.append(sum(seen) / len(seen))
    assert found["pupil"] == pytest.approx(np.mean(sizes))


def test_of_two_streams_none_is_chosen_and_a_time_without_samples_is_missing() -> None:
    beats = np.arange(0.0, 60.0)
    one = a_stream(beats, HeartRate=np.full(60, 70.0))
    none = [
        BodySignals(a_session(one, one)).measures(0.0, 9.0),
        BodySignals(a_session()).measures(0.0, 9.0),
    ]
    none.append(BodySignals(a_session(one)).measures(10.2, 10.8))
    assert all(np.isnan([*each.values()]).all() for each in none)
    assert BodySignals(a_session(one)).measures(10.0, 11.0)["heart_rate"] == 70.0
