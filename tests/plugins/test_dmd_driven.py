"""The simulated arm, driven signal by signal as the real one was, against the formula."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cranes import needs_bullet
from dmd_arms import MODEL, RETRIEVAL
from scipy.integrate import quad

import labcrane_dmd
from labcrane import ProtocolError
from labcrane.machines import load_machine
from labcrane.testing import main
from labcrane_dmd.fit.recordings import read_recordings

FOLDER = RETRIEVAL / "hydraulic_arm"
RATE_HZ = 240.0


def driven(
    names: tuple[str, ...], sizes: tuple[int, ...], rate_hz: float = RATE_HZ, path: Path = MODEL
):
    from labcrane_dmd.fit.driven import arm_settings, drive

    model = labcrane_dmd.load(path)
    settings = model.settings.model_copy(update={"validation": sizes})
    model = replace(model, segments={name: model[name] for name in names}, settings=settings)
    machine = load_machine("ied_arm.yaml", RETRIEVAL)
    recordings = [each for each in read_recordings(FOLDER) if each.name in names]
    arm = arm_settings(machine, model, path)
    return model, drive(arm, model, machine, recordings, rate_hz)


def agrees_with_the_formula(model, level, rate_hz: float = RATE_HZ) -> None:
    """Assert that time between two angles is the formula's, but for what explicit steps add.

    Steps at the speed of their beginning take dt / 2 ln(w(b) / w(a)) longer than the integral of
    1 / w from a to b, to first order in dt (the modified equation of Euler's method).
    """
    segment, run = model[level.level.segment], level.run
    direction = segment.direction(run.signal)
    assert level.formula_error < 1e-6
    if segment.speed(run.signal, float(run.angle[0])) == 0.0:
        assert np.ptp(run.angle) < 1e-6
        return
    opened = run.time[run.step] + direction.dead_time + 25.0 * direction.lag
    first = int(np.searchsorted(run.time, opened))
    said = [segment.speed(run.signal, float(at)) for at in run.angle[:-1]]
    moving = np.flatnonzero(np.abs(np.diff(run.angle)) * rate_hz > 0.5 * np.abs(said))
    last = int(moving[-1]) - 2  # the end stop cuts the last step short
    assert last - first > 0.2 * rate_hz
    a, b = float(run.angle[first]), float(run.angle[last])
    needs, _ = quad(lambda at: 1.0 / segment.speed(run.signal, at), a, b, limit=500)
    dt = 1.0 / rate_hz
    adds = 0.5 * dt * math.log(segment.speed(run.signal, b) / segment.speed(run.signal, a))
    took = (last - first) * dt
    where = (segment.name, run.signal)
    assert took == pytest.approx(needs + adds, abs=0.02 * dt + 1e-6 * needs), where


@pytest.mark.slow
@needs_bullet
@pytest.mark.parametrize(("seed", "name"), list(enumerate(["arm", "boom", "jaws"])))
def test_driven_segments_move_as_the_formula_says_within_the_integrators_error(
    seed: int, name: str
) -> None:
    # Two of the paper's six levels: all are driven by the test after this one, which takes its
    # time; at 20 the way is as long as at all others together.
    draw = np.random.default_rng([seed, 240])
    slow, fast = int(draw.choice([60, 100])), int(draw.choice([140, 180, 220]))
    model, levels = driven((name,), (slow, fast))
    assert [each.level.signal for each in levels] == [-fast, -slow, 0, slow, fast]
    for each in levels:
        agrees_with_the_formula(model, each)
        level = each.level
        said = [model[name].speed(level.signal, math.radians(at)) for at in level.angle.tolist()]
        measured = float(level.predicted.mean())
        assert measured == pytest.approx(float(np.degrees(said).mean()), rel=0.005, abs=1e-9)


@needs_bullet
@pytest.mark.long
def test_every_segment_direction_and_level_of_the_paper_is_driven_and_agrees() -> None:
    model, levels = driven(("arm", "boom", "jaws"), (20, 60, 100, 140, 180, 220))
    assert len(levels) == 3 * 13
    for each in levels:
        agrees_with_the_formula(model, each)


@needs_bullet
@pytest.mark.long
def test_a_model_of_the_papers_own_rule_is_driven_and_agrees(tmp_path: Path) -> None:
    """No dead band, and straight lines between the grid's signals."""
    path = tmp_path / "arm.yaml"
    words = ["--edge", "", "--dead-band", "none", "--between", "linear"]
    assert main(["dmd", "fit", str(FOLDER), "--out", str(path), *words]) == 0
    drawn = np.random.default_rng().choice([60, 100, 140, 180, 220], 2, replace=False)
    model, levels = driven(("arm", "boom", "jaws"), tuple(sorted(drawn.tolist())), path=path)
    assert len(levels) == 3 * 5
    for each in levels:
        agrees_with_the_formula(model, each)


@pytest.mark.slow
@needs_bullet
def test_the_command_drives_the_arm_and_leaves_the_papers_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    short = tmp_path / "arm"
    short.mkdir()
    for name in ("arm", "boom", "jaws"):
        table = pd.read_csv(FOLDER / f"{name}.csv.gz")
        wanted = [0, 120, -120, 200, -200, 220, -220, 250, -250]
        named = table.groupby("run").signal.transform(lambda signal: signal.iloc[-1])
        kept = table[named.isin(wanted) & ((named != 0) | (table.time_s < 6.0))]
        kept.to_csv(short / f"{name}.csv", index=False)
    model, out = tmp_path / "arm.yaml", tmp_path / "out"
    grid = ["--levels", "120,200,250", "--validation", "220", "--edge", ""]
    assert main(["dmd", "fit", str(short), "--out", str(model), *grid]) == 0
    words = ["dmd", "validate", str(model), str(short), "--out", str(out), "--drive"]
    assert main(words) == 2
    assert "name the machine: --machine ied_arm.yaml" in capsys.readouterr().err
    assert main([*words, "--machine", str(RETRIEVAL / "ied_arm.yaml")]) == 0
    table = pd.read_csv(out / "driven.csv")
    assert list(table.signal) == [-220, 0, 220] * 3
    assert (table.formula_error < 1e-6).all()
    assert (table.rmse < 0.2).all()
    summary = pd.read_csv(out / "driven_summary.csv").set_index("segment")
    assert list(summary.index) == ["arm", "boom", "jaws"]
    assert main(["dmd", "plot", str(model), "--recordings", str(short)]) == 0
    for ending in ("", "_angle", "_speed"):
        assert (tmp_path / f"arm{ending}.png").read_bytes().startswith(b"\x89PNG")


@needs_bullet
def test_a_machine_without_the_models_segments_is_refused() -> None:
    from labcrane_dmd.fit.driven import arm_settings, drive

    model = labcrane_dmd.load(MODEL)
    ch8 = load_machine("ch8")
    with pytest.raises(ProtocolError, match=r"no joint 'arm', 'boom', 'jaws', which the model"):
        drive(arm_settings(ch8, model, MODEL), model, ch8, (), RATE_HZ)
