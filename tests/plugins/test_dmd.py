"""Models from recordings: on the shared machine, on another one, and on recordings gone wrong."""

import gzip
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from dmd_machine import LEVELS, record, true_speed

import labcrane_dmd
from labcrane import ProtocolError, RecordingError
from labcrane.testing import main
from labcrane_dmd.arm.drive import SegmentDrive
from labcrane_dmd.fit.fitting import LAGS, curve_at, fit_model, fit_segment
from labcrane_dmd.fit.recordings import read_recordings
from labcrane_dmd.fit.validation import validate
from labcrane_dmd.model.interpolation import linear, pchip
from labcrane_dmd.model.model import Model
from labcrane_dmd.model.model_file import save
from labcrane_dmd.model.settings import FitSettings

FOLDER = Path(__file__).parents[2] / "protocols" / "retrieval" / "hydraulic_arm"
PCHIP = FitSettings(between="pchip")


@pytest.fixture(scope="module")
def recordings():
    return read_recordings(FOLDER)


@pytest.fixture(scope="module")
def model(recordings) -> Model:
    return fit_model(recordings, PCHIP)


def recorded_mean(name: str, signal: int, lowest: float, highest: float) -> float:
    """Return the mean speed over angle in deg/s by a way of its own: crossing times of the ends."""
    table = pd.read_csv(FOLDER / f"{name}.csv.gz")
    rows = table[table.run == table[table.signal == signal].run.iloc[0]]
    rows = rows[rows.signal == signal]
    smooth = rows.angle_deg.rolling(25, center=True).mean().to_numpy()
    inside = (smooth >= lowest) & (smooth <= highest)
    angle, time = smooth[inside], rows.time_s.to_numpy()[inside]
    # Mean over angle of dθ/dt: crossing times of a grid of angles, each cell by its own duration.
    edges = np.linspace(angle.min(), angle.max(), 60)
    order = np.argsort(angle)
    crossed = np.interp(edges, angle[order], time[order])
    return float(np.mean(np.diff(edges) / np.diff(crossed)))


@pytest.mark.slow
def test_mean_speeds_at_signals_that_the_fit_never_saw_are_within_the_papers_error(
    model, recordings
) -> None:
    checked = 0
    for level in validate(model, recordings):
        if abs(level.signal) < 100:
            continue
        row = level.row()
        theirs = recorded_mean(level.segment, level.signal, row["from_deg"], row["to_deg"])
        assert row["mean_speed"] == pytest.approx(theirs, rel=0.01)
        for recorded in (row["mean_speed"], theirs):
            error = abs(row["model_mean_speed"] - recorded)
            assert error < 0.1, (level.segment, level.signal)
            assert error < 0.019 * abs(recorded), (level.segment, level.signal)
        checked += 1
    assert checked == 3 * 2 * 4


@pytest.mark.slow
def test_the_fit_does_not_look_at_validation_signals(model, recordings) -> None:
    from dataclasses import replace

    (arm, *_) = recordings
    spoilt = tuple(
        replace(run, angle=run.angle[::-1].copy()) if abs(run.signal) in PCHIP.validation else run
        for run in arm.runs
    )
    assert fit_segment(replace(arm, runs=spoilt), PCHIP) == model["arm"]


@pytest.mark.slow
def test_a_refit_gives_the_same_file_and_the_file_the_same_speeds(
    model, recordings, tmp_path: Path
) -> None:
    save(model, tmp_path / "one.yaml")
    save(fit_model(recordings, PCHIP), tmp_path / "two.yaml")
    assert (tmp_path / "one.yaml").read_bytes() == (tmp_path / "two.yaml").read_bytes()
    read = labcrane_dmd.load(tmp_path / "one.yaml")
    for name, segment in model.items():
        for signal in (-250, -60, -20, 0, 33, 140, 250):
            for angle in np.linspace(*segment.limits, 7).tolist():
                assert read[name].speed(signal, angle) == pytest.approx(
                    segment.speed(signal, angle), rel=1e-7, abs=1e-10
                )


@pytest.mark.slow
def test_the_file_beside_the_protocol_is_the_fit_of_its_recordings(model, tmp_path: Path) -> None:
    save(model, tmp_path / "arm.yaml")
    assert (tmp_path / "arm.yaml").read_text(encoding="utf-8") == (
        FOLDER.parent / "arm.dmd.yaml"
    ).read_text(encoding="utf-8")


@pytest.mark.slow
def test_level_zero_and_the_dead_band_stand_still_and_speed_rises_from_its_edge(model) -> None:
    for segment in model.values():
        for angle in np.linspace(*segment.limits, 5).tolist():
            for direction, sign in ((segment.extend, 1), (segment.retract, -1)):
                assert 10 < direction.dead_band < 30
                assert segment.speed(sign * direction.dead_band, angle) == 0.0
                sizes = np.linspace(direction.dead_band, 250, 200)
                speeds = [sign * segment.speed(sign * size, angle) for size in sizes.tolist()]
                assert (np.diff(speeds) > 0.0).all()
            assert segment.speed(0, angle) == 0.0


@pytest.mark.slow
def test_nothing_is_extrapolated_beyond_the_measured_angles(model) -> None:
    for segment in model.values():
        for signal in (-250, -40, 40, 250):
            for end, beyond in zip(segment.limits, (-1.0, 1.0), strict=True):
                far = segment.speed(signal, end + beyond)
                assert far == pytest.approx(segment.speed(signal, end), rel=0.02)


@pytest.mark.slow
def test_the_layers_have_the_run_up_of_the_lag_that_is_found_with_them(model, recordings) -> None:
    for recording in recordings:
        segment = model[recording.name]
        for direction, sign in ((segment.extend, 1), (segment.retract, -1)):
            run_up = direction.dead_time + LAGS * direction.lag
            for layer in direction.layers:
                curve = curve_at(recording, layer.signal, run_up)
                assert curve is not None
                # The far end is measured; on the other side are the weaker layers' angles.
                far, near = (1, 0) if sign > 0 else (0, 1)
                assert layer.covers[far] == pytest.approx(curve.covers[far], abs=1e-9)
                assert sign * layer.covers[near] <= sign * curve.covers[near] + 1e-9
                found = [layer.speed(angle) for angle in curve.angle.tolist()]
                missed = np.array(found) - curve.speed
                assert np.sqrt(np.mean(missed**2)) < 0.01 * np.abs(curve.speed).max()


@pytest.mark.slow
def test_every_joint_sets_off_when_its_recording_does(model, recordings) -> None:
    late = []
    for recording in recordings:
        for signal in (-250, -220, -200, -180, 180, 200, 220, 250):
            (run,) = recording.at(signal)
            drive, dt = SegmentDrive(model[recording.name], 0.001), 0.001
            angle = float(np.mean(run.angle[: run.step]))
            path = [angle := angle + dt * drive.speed(signal, angle) for _ in range(4000)]
            seen = run.angle[run.step :] - np.mean(run.angle[: run.step])
            for degrees in (2.0, 4.0, 6.0):
                came = [
                    int(np.argmax(np.abs(moved) > np.radians(degrees))) * step
                    for moved, step in ((np.array(path) - run.angle[0], dt), (seen, run.interval))
                ]
                late.append(came[0] - came[1])
    # The recorded valve's own dead time differs from run to run.
    assert abs(np.mean(late)) < 0.015
    assert np.abs(late).max() < 0.05


@pytest.mark.slow
def test_slow_layers_say_that_they_do_not_cover_the_range_and_go_like_the_next(model) -> None:
    (slow, *_) = model["arm"].extend.layers
    assert not slow.whole
    assert all(layer.whole for layer in model["arm"].extend.layers[1:])
    beyond = slow.covers[1] + 0.8
    here, there = (model["arm"].speed(80, angle) for angle in (slow.covers[1], beyond))
    expected = model["arm"].speed(40, slow.covers[1]) * there / here
    assert model["arm"].speed(40, beyond) == pytest.approx(expected)


def test_between_layers_is_a_line_or_scipys_monotone_cubic() -> None:
    from scipy.interpolate import PchipInterpolator

    random = np.random.default_rng(3)
    for _ in range(50):
        count = random.integers(2, 8)
        signals = np.cumsum(random.uniform(5, 60, count)).tolist()
        speeds = random.normal(size=count).cumsum().tolist()
        theirs = PchipInterpolator(signals, speeds)
        for at in random.uniform(signals[0], signals[-1], 20).tolist():
            assert pchip(at, signals, speeds) == pytest.approx(float(theirs(at)), abs=1e-12)
            assert linear(at, signals, speeds) == pytest.approx(np.interp(at, signals, speeds))


@pytest.mark.slow
def test_a_signal_beyond_full_flow_is_refused(model) -> None:
    for signal in (251, -300, math.nan):
        with pytest.raises(ProtocolError, match=r"'boom': signal .+ is not within -250 to 250"):
            model["boom"].speed(signal, 0.0)


@pytest.mark.slow
def test_another_machines_law_is_found_in_its_recordings(tmp_path: Path) -> None:
    record(tmp_path / "stick.csv.gz")
    (stick,) = read_recordings(tmp_path)
    segment = fit_segment(stick, PCHIP)
    for signal in LEVELS:
        if abs(signal) < 100 or signal in (0,):
            continue
        angles = np.linspace(math.radians(5), math.radians(55), 40).tolist()
        model = np.mean([segment.speed(signal, angle) for angle in angles])
        truth = np.mean([true_speed(signal, angle) for angle in angles])
        assert abs(model / truth - 1) < 0.01, signal
    for direction in (segment.extend, segment.retract):
        assert direction.dead_band == pytest.approx(22.0, abs=3.0)
        assert direction.dead_time == pytest.approx(0.08, abs=0.015)
        assert direction.lag == pytest.approx(0.12, abs=0.015)
    # Where it sets off, stronger signals have gone by before the valve was open.
    for signal in (-250, -200, -160, 160, 200, 250):
        first = (0.0, 8.0) if signal > 0 else (52.0, 60.0)
        for angle in np.radians(np.linspace(*first, 9)).tolist():
            assert segment.speed(signal, angle) == pytest.approx(
                true_speed(signal, angle), rel=0.03
            )


def spoil(tmp_path: Path, change) -> Path:
    table = pd.read_csv(FOLDER / "jaws.csv.gz")
    path = tmp_path / "jaws.csv.gz"
    change(table).to_csv(path, index=False)
    return path


WRONG = {
    "gap": (
        lambda t: t.drop(index=range(3000, 3040)),
        r"jaws.csv.gz, run \d+: 0.41 s without a sample after [\d.]+ s, where 0.01 s are usual",
    ),
    "nan": (
        lambda t: t.assign(angle_deg=t.angle_deg.where(t.index != 77)),
        r"has 1 samples that are not numbers, the first in line 79",
    ),
    "rad": (
        lambda t: t.assign(angle_deg=np.radians(t.angle_deg)),
        r"moves by 1 degrees in all its runs; angle_deg is in degrees, not rad",
    ),
    "rad column": (
        lambda t: t.rename(columns={"angle_deg": "angle_rad"}),
        r"has no column 'angle_deg'; its columns are run, time_s, signal, angle_rad",
    ),
    "milliseconds": (
        lambda t: t.assign(time_s=1000 * t.time_s),
        r"samples are 10 s apart; time_s is in seconds",
    ),
    "percent": (
        lambda t: t.assign(signal=t.signal * 0.4),
        r"the largest signal is 100; a model needs recordings up to 250",
    ),
    "one direction": (
        lambda t: t[t.groupby("run").signal.transform("min") >= 0],
        r"jaws.csv.gz has no runs with negative signals; a model needs both directions",
    ),
    "backward time": (
        lambda t: t.assign(time_s=t.time_s.where(t.index != 500, 0.0)),
        r"time does not go on after [\d.]+ s; it must rise",
    ),
    "constant angle": (
        lambda t: t.assign(
            angle_deg=t.angle_deg.where(t.groupby("run").signal.transform("max") != 120, 20.0)
        ),
        r"the angle does not change at signal 120, though it does at 80",
    ),
    "wrong sign": (
        lambda t: t.assign(signal=-t.signal),
        r"the angle goes against signal -?250; turn the sensor's sign round",
    ),
    "missing level": (
        lambda t: t[t.groupby("run").signal.transform("max") != 160],
        r"has no run at signal 160, which the model needs",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", WRONG)
def test_recordings_gone_wrong_are_refused_in_words(case: str, tmp_path: Path) -> None:
    change, message = WRONG[case]
    path = spoil(tmp_path, change)
    with pytest.raises(RecordingError, match=message):
        fit_model(read_recordings(path), PCHIP)


def test_what_is_no_recording_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"holds no recordings; they are files like boom"):
        read_recordings(tmp_path)
    with pytest.raises(RecordingError, match=r"does not exist"):
        read_recordings(tmp_path / "boom.csv")
    (tmp_path / "boom.csv.gz").write_bytes(gzip.compress(b"\x00\xff\x00")[:-9])
    with pytest.raises(RecordingError, match=r"boom.csv.gz cannot be read as CSV"):
        read_recordings(tmp_path)


@pytest.mark.slow
def test_the_commands_leave_model_tables_and_figures(tmp_path: Path, capsys) -> None:
    arm = str(tmp_path / "arm.yaml")
    assert main(["dmd", "fit", str(FOLDER), "--out", arm, "--between", "pchip"]) == 0
    assert main(["dmd", "validate", arm, str(FOLDER), "--out", str(tmp_path / "out")]) == 0
    assert main(["dmd", "plot", arm, "--out", str(tmp_path / "arm.png")]) == 0
    table = pd.read_csv(tmp_path / "out" / "validation.csv")
    named = ["segment", "direction", "signal", "mean_speed", "mse", "rmse", "mae", "max_abs_error"]
    assert list(table)[:8] == named
    assert len(table) == 39  # six signals in both directions, and 0, of three segments
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        f"{name}{rule}.{kind}"
        for rule in ("", "_linear")
        for name, kind in (("validation", "csv"), ("validation", "png"), ("summary", "csv"))
    }
    assert (tmp_path / "arm.png").read_bytes().startswith(b"\x89PNG")
    assert main(["dmd", "validate", str(tmp_path / "no.yaml"), str(FOLDER)]) == 2
    assert "does not exist; check its name" in capsys.readouterr().err
    with pytest.raises(RecordingError, match=r"arm.yaml cannot be written: No such file or"):
        save(labcrane_dmd.load(Path(arm)), tmp_path / "no folder" / "arm.yaml")


@pytest.mark.slow
def test_the_command_fits_other_grids_as_a_line_through_two_sets_of_speeds(
    tmp_path: Path,
) -> None:
    arm = tmp_path / "arm.yaml"
    grid = ["--levels", "120,250", "--validation", "160,200,220", "--edge", ""]
    assert main(["dmd", "fit", str(FOLDER), "--out", str(arm), *grid]) == 0
    model = labcrane_dmd.load(arm)
    assert model.settings.levels == (120, 250)
    boom = model["boom"]
    angle = sum(boom.limits) / 2.0
    low, high = boom.speed(120, angle), boom.speed(250, angle)
    assert low != high
    for signal in (130, 185, 240):
        line = low + (signal - 120) / 130 * (high - low)
        assert boom.speed(signal, angle) == pytest.approx(line, rel=1e-9)
    assert main(["dmd", "validate", str(arm), str(FOLDER), "--out", str(tmp_path / "out")]) == 0
    table = pd.read_csv(tmp_path / "out" / "validation.csv")
    assert sorted(table["signal"].abs().unique()) == [0, 160, 200, 220]


@pytest.mark.slow
def test_the_papers_own_rule_is_a_line_from_0_that_other_runs_do_not_bend(
    recordings, tmp_path: Path
) -> None:
    arm = tmp_path / "arm.yaml"
    words = ["--edge", "", "--dead-band", "none", "--between", "linear"]
    assert main(["dmd", "fit", str(FOLDER), "--out", str(arm), *words]) == 0
    model = labcrane_dmd.load(arm)
    random = np.random.default_rng(2)
    for segment in model.values():
        for sign in (1, -1):
            assert segment.direction(sign).dead_band == 0.0
            for angle in random.uniform(*segment.limits, 5).tolist():
                grid = {size: segment.speed(sign * size, angle) for size in (40, 80)}
                assert segment.speed(sign * 20, angle) == pytest.approx(grid[40] / 2, rel=1e-9)
                assert segment.speed(sign * 60, angle) == pytest.approx(
                    (grid[40] + grid[80]) / 2, rel=1e-9
                )
    other = [
        replace(each, runs=tuple(run for run in each.runs if abs(run.signal) not in {10, 30, 50}))
        for each in recordings
    ]
    save(fit_model(other, model.settings), tmp_path / "other.yaml")
    assert dict(labcrane_dmd.load(tmp_path / "other.yaml")) == dict(model)


@pytest.mark.parametrize(
    ("words", "refused"),
    [
        (("--levels", "40;80"), "--levels '40;80' is not a list of signals; write whole numbers"),
        (("--levels", "-40,80"), "--levels has -40; write sizes above 0, each is used in both"),
        (("--levels", ""), "a model needs at least one level; write the signals of its layers"),
        (("--validation", "20,80"), "signal 80 is to validate the model and to be fitted; leave"),
    ],
)
def test_grids_that_make_no_sense_are_refused_in_words(
    words: tuple[str, str], refused: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["dmd", "fit", str(FOLDER), "--out", str(tmp_path / "arm.yaml"), *words]) == 2
    assert refused in capsys.readouterr().err
