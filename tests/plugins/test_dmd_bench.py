"""The bench: the simulated arm driven signal by signal, and joints recorded from what is there."""

import csv
import math
import re
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import can
import cantools
import numpy as np
import pandas as pd
import pytest
from cranes import needs_bullet
from dmd_arms import MODEL, RETRIEVAL
from scipy.integrate import quad

import labcrane_dmd
from labcrane import DeviceError, ProtocolError, RecordingError
from labcrane.cli.app import main
from labcrane.machines import load_machine
from labcrane_dmd.bench.sources import CanValues, read_bus, read_log
from labcrane_dmd.bench.steps import Sample, cut
from labcrane_dmd.fit.recordings import read_recordings

FOLDER = RETRIEVAL / "hydraulic_arm"
RATE_HZ = 240.0

PANEL = """VERSION ""

BU_: PANEL

BO_ 256 Levers: 4 PANEL
 SG_ Boom : 0|16@1- (0.1,0) [-100|100] "%" PANEL

BO_ 257 Encoders: 4 PANEL
 SG_ Boom : 0|32@1- (0.001,0) [-180|180] "deg" PANEL
 SG_ Raw : 0|16@1- (1,0) [0|100] "" PANEL
"""


def driven(
    names: tuple[str, ...], sizes: tuple[int, ...], rate_hz: float = RATE_HZ, path: Path = MODEL
):
    from labcrane_dmd.bench.driven import arm_settings, drive

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
    third = (out / "table_3_driven.md").read_text().splitlines()
    assert third[0] == "| Segment | MSE | RMSE | MAE | Residual variance |"
    assert [line.split("|")[1].strip() for line in third[2:]] == ["arm", "boom", "jaws"]
    summary = pd.read_csv(out / "driven_summary.csv").set_index("segment")
    printed = third[3].split("|")[3].strip()
    assert printed == f"{summary.loc['boom', 'rmse']:.4f}"
    fourth = (out / "table_4_driven.md").read_text().splitlines()
    assert len(fourth) == 2 + 9
    boom = table[(table.segment == "boom") & (table.signal == 220)].iloc[0]
    assert fourth[2 + 5].split("|")[3].strip() == f"{boom.mean_speed:.3f}"
    assert (out / "table_4_driven.tex").read_text().startswith(r"\begin{tabular}{lrrrrr}")
    assert main(["dmd", "plot", str(model), "--recordings", str(short)]) == 0
    for ending in ("", "_angle", "_speed"):
        assert (tmp_path / f"arm{ending}.png").read_bytes().startswith(b"\x89PNG")


@needs_bullet
def test_a_machine_without_the_models_segments_is_refused() -> None:
    from labcrane_dmd.bench.driven import arm_settings, drive

    model = labcrane_dmd.load(MODEL)
    ch8 = load_machine("ch8")
    with pytest.raises(ProtocolError, match=r"no joint 'arm', 'boom', 'jaws', which the model"):
        drive(arm_settings(ch8, model, MODEL), model, ch8, (), RATE_HZ)


def steps(seed: int) -> tuple[list[tuple[float, float, float]], list[int]]:
    """Return rows of time, signal and angle of a joint that goes to and fro, and its steps."""
    random = np.random.default_rng(seed)
    levels = [int(sign * random.integers(5, 26) * 10) for sign in (1, -1, 1, -1)]
    rows, now, angle = [], float(random.uniform(0.0, 1e3)), 10.0
    for level in levels:
        for signal, lasts in ((0, random.uniform(0.7, 2.0)), (level, random.uniform(2.0, 4.0))):
            for _ in range(round(lasts * 100.0)):
                angle += 0.01 * signal / 250.0 * 8.0
                rows.append((now, float(signal), angle))
                now += 0.01
    for _ in range(700):
        rows.append((now, 0.0, angle))
        now += 0.01
    return rows, levels


@pytest.mark.parametrize("seed", range(5))
def test_a_log_is_cut_into_the_steps_that_were_made(seed: int) -> None:
    rows, levels = steps(seed)
    samples = [s for t, u, a in rows for s in (Sample(t, "signal", u), Sample(t, "angle_deg", a))]
    found = cut(samples)
    assert [step.signal for step in found] == [*levels, 0]
    for step in found:
        assert step.left_out == ""
        if step.signal:
            assert float(np.sum(step.signals == 0.0)) == pytest.approx(50, abs=1)
            assert set(step.signals.tolist()) == {0.0, float(step.signal)}
    ramp = [Sample(0.01 * n, "signal", min(float(n), 250.0)) for n in range(600)]
    ramp += [Sample(0.01 * n, "angle_deg", 0.1 * n) for n in range(600)]
    with pytest.raises(RecordingError, match=r"no step of the log is a run: signal 1 was held for"):
        cut(ramp)


def test_a_signal_beyond_full_flow_or_without_a_number_is_refused_but_not_for_rounding() -> None:
    rows, _ = steps(1)
    angles = [Sample(t, "angle_deg", a) for t, _, a in rows]
    signals = [Sample(t, "signal", 250.00000001 if u else 0.0) for t, u, _ in rows]
    assert {step.signal for step in cut([*signals, *angles])} == {250, 0}
    for wrong in (251.0, math.nan):
        bad = Sample(rows[5][0], "signal", wrong)
        with pytest.raises(RecordingError, match=r"beyond -250 to 250, which are full flow; see"):
            cut([*signals, bad, *angles])


def test_a_bus_that_cannot_be_opened_is_refused_and_what_came_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from labcrane_dmd.bench import sources

    panel = panel_file(tmp_path)
    words = ["dmd", "record", str(tmp_path / "kept"), "--segment", "boom", "--map", str(panel)]
    words += ["--signal", "Levers.Boom", "--angle", "Encoders.Boom"]
    assert main([*words, "--bus", "nothing:there"]) == 1
    assert "the bus 'nothing:there' cannot be opened" in capsys.readouterr().err

    def lost(*_: object):
        yield Sample(1.0, "angle_deg", 3.0)
        raise DeviceError("the bus 'x:y' is lost: unplugged")

    monkeypatch.setattr(sources, "read_bus", lost)
    words[2] = str(tmp_path / "again")
    assert main([*words, "--bus", "x:y"]) == 1
    raw = tmp_path / "again" / "raw" / "boom.csv"
    assert raw.read_text().splitlines()[1:] == ["1.0,angle_deg,3.0"]
    said = " ".join(capsys.readouterr().err.split())
    assert "cut it into runs with --log" in said


def bus_log(path: Path, rows, dbc) -> None:
    with path.open("w", encoding="ascii") as file:
        for now, signal, angle in rows:
            for name, value in (("Levers", signal / 2.5), ("Encoders", angle)):
                message = dbc.get_message_by_name(name)
                data = {"Boom": value} if name == "Levers" else {"Boom": value, "Raw": 0}
                data = {k: v for k, v in data.items() if k == "Boom"}
                raw = message.encode(data, strict=False, padding=True)
                file.write(f"({now:.6f}) can0 {message.frame_id:03X}#{raw.hex().upper()}\n")


def panel_file(folder: Path) -> Path:
    path = folder / "panel.dbc"
    path.write_text(PANEL.replace(' SG_ Raw : 0|16@1- (1,0) [0|100] "" PANEL\n', ""))
    return path


def test_a_replayed_log_becomes_a_recording_that_fit_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    panel = panel_file(tmp_path)
    rows, levels = steps(11)
    log, folder = tmp_path / "drive.log", tmp_path / "recorded"
    bus_log(log, rows, cantools.database.load_file(panel))
    words = ["dmd", "record", str(folder), "--segment", "boom", "--log", str(log)]
    words += ["--map", str(panel), "--signal", "Levers.Boom", "--angle", "Encoders.Boom"]
    assert main(words) == 0
    table = pd.read_csv(folder / "boom.csv")
    assert list(table) == ["run", "time_s", "signal", "angle_deg"]
    runs = table.groupby("run").signal.last()
    assert sorted(runs) == sorted([*levels, 0])
    with (folder / "steps" / "boom.csv").open() as file:
        assert [int(row["signal"]) for row in csv.DictReader(file)] == [*levels, 0]
    raw = pd.read_csv(folder / "raw" / "boom.csv")
    assert len(raw) == 2 * len(rows)
    first = rows[0][2]
    assert raw[raw.what == "angle_deg"].value.iloc[0] == pytest.approx(first, abs=5e-4)
    assert main(words) == 2
    assert "already exists, and recordings are not overwritten" in capsys.readouterr().err
    again = tmp_path / "again"
    raw_words = ["dmd", "record", str(again), "--segment", "boom", "--signal", "-", "--angle", "-"]
    assert main([*raw_words, "--log", str(folder / "raw" / "boom.csv")]) == 0
    assert (again / "boom.csv").read_bytes() == (folder / "boom.csv").read_bytes()
    wrong = [word if word != "Encoders.Boom" else "Encoders.Arm" for word in words]
    wrong[2] = str(tmp_path / "wrong")
    assert main(wrong) == 1
    assert "'Encoders.Arm' is not in" in capsys.readouterr().err


def test_an_asc_log_that_counts_from_frame_to_frame_gives_the_same_samples(
    tmp_path: Path,
) -> None:
    panel, rows = panel_file(tmp_path), steps(12)[0]
    values = CanValues("Levers.Boom", "Encoders.Boom", panel, 100.0)
    bus_log(tmp_path / "drive.log", rows, cantools.database.load_file(panel))
    expected = list(read_log(tmp_path / "drive.log", values))
    with can.Logger(tmp_path / "drive.asc") as log:
        for frame in can.LogReader(tmp_path / "drive.log"):
            log(frame)
    lines, was = (tmp_path / "drive.asc").read_text().split("\n"), 0.0
    for at, line in enumerate(lines):
        if found := re.match(r" *(\d+\.\d+)( .*)", line):
            now = float(found[1])
            lines[at], was = f"{now - was:11.6f}{found[2]}", now
    text = "\n".join(lines).replace("timestamps absolute", "timestamps relative")
    (tmp_path / "relative.asc").write_text(text)
    for name in ("drive.asc", "relative.asc"):
        found = list(read_log(tmp_path / name, values))
        assert [one.value for one in found] == [one.value for one in expected]
        times = np.array([[one.time for one in each] for each in (found, expected)])
        # Digits of the log are millionths of a second, and differences of them add up.
        np.testing.assert_allclose(*(times - times[:, :1]), atol=1e-6 * len(expected))


def test_a_log_whose_clock_was_set_back_tells_no_speed(tmp_path: Path) -> None:
    panel, rows = panel_file(tmp_path), steps(12)[0]
    rows[40:] = [(now - 3.0, *rest) for now, *rest in rows[40:]]
    bus_log(tmp_path / "drive.log", rows, cantools.database.load_file(panel))
    values = CanValues("Levers.Boom", "Encoders.Boom", panel, 100.0)
    said = r"drive.log goes back by 2\.\d+ s at its frame 81, so the speed there is unknown"
    with pytest.raises(RecordingError, match=said):
        list(read_log(tmp_path / "drive.log", values))


def test_a_lever_that_rests_at_50_gives_the_same_signals(tmp_path: Path) -> None:
    panel, rows = panel_file(tmp_path), steps(13)[0]
    bus_log(tmp_path / "drive.log", rows, cantools.database.load_file(panel))
    text = panel.read_text()
    assert "Boom : 0|16@1- (0.1,0) [-100|100]" in text
    shifted = text.replace(
        "Boom : 0|16@1- (0.1,0) [-100|100]", "Boom : 0|16@1- (0.05,50) [0|100]", 1
    )
    (tmp_path / "shifted.dbc").write_text(shifted)
    found = [
        [one.value for one in read_log(tmp_path / "drive.log", values)]
        for values in (
            CanValues("Levers.Boom", "Encoders.Boom", panel, 100.0),
            CanValues("Levers.Boom", "Encoders.Boom", tmp_path / "shifted.dbc", 100.0, 50.0),
        )
    ]
    assert found[0] == pytest.approx(found[1])
    with pytest.raises(
        ProtocolError, match="--full is 50 and --neutral 50; full flow is a greater"
    ):
        CanValues("Levers.Boom", "Encoders.Boom", panel, 50.0, 50.0)


def test_a_live_bus_gives_the_valve_commands_and_angles_that_are_on_it(tmp_path: Path) -> None:
    import can

    panel = panel_file(tmp_path)
    encoders = cantools.database.load_file(panel).get_message_by_name("Encoders")
    sent, over = [], threading.Event()

    def talk() -> None:
        with can.Bus(interface="virtual", channel="dmd-bench") as bus:
            number = 0
            while not over.is_set():
                signal = (0, 130, -40, 250)[number % 4]
                state = 1 if signal > 0 else 2 if signal < 0 else 0
                data = bytes([abs(signal), 0xFF, 0x30 | state, *[0xFF] * 5])
                bus.send(can.Message(arbitration_id=0x0CFE3321, data=data))
                bus.send(can.Message(arbitration_id=0x0CFE3221, data=data))  # another valve
                angle = encoders.encode({"Boom": 0.5 * number}, padding=True)
                bus.send(can.Message(arbitration_id=257, data=angle, is_extended_id=False))
                sent.append((signal, 0.5 * number))
                number += 1
                time.sleep(0.005)

    values = CanValues("3", "Encoders.Boom", panel, 100.0)
    thread = threading.Thread(target=talk)
    source = read_bus("virtual:dmd-bench", 250_000, values, 60.0)
    thread.start()
    try:
        came = [next(source) for _ in range(40)]
    finally:
        over.set()
        source.close()
        thread.join()
    signals = [sample.value for sample in came if sample.what == "signal"]
    angles = [sample.value for sample in came if sample.what == "angle_deg"]
    assert len(signals) == len(angles) == 20
    first = [angle for _, angle in sent].index(angles[0])
    pairs = zip(signals, angles, strict=True)
    assert [(int(s), a) for s, a in pairs] == pytest.approx(sent[first : first + 20])


@pytest.mark.slow
def test_lsl_streams_become_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import pylsl

    def outlet(name: str, unit: str) -> "pylsl.StreamOutlet":
        info = pylsl.StreamInfo(name, "Control", 2, 0.0, "double64", f"{name}/{tmp_path.name}")
        info.set_channel_labels(["arm", "boom"])
        info.set_channel_units([unit, unit])
        return pylsl.StreamOutlet(info)

    flows, angles = f"flow-{tmp_path.name}", f"angle-{tmp_path.name}"
    signal_out, angle_out = outlet(flows, "0.4 percent"), outlet(angles, "rad")
    rows, levels = steps(3)

    def talk() -> None:
        signal_out.wait_for_consumers(240.0)
        angle_out.wait_for_consumers(240.0)
        start = pylsl.local_clock()
        for now, signal, angle in rows:
            stamp = start + now - rows[0][0]
            signal_out.push_sample([7.0, signal], stamp)
            angle_out.push_sample([0.0, math.radians(angle)], stamp + 1e-3)

    thread = threading.Thread(target=talk)
    thread.start()
    folder = tmp_path / "recorded"
    words = ["--lsl", "--signal", flows, "--angle", f"{angles}:boom", "--seconds", "6"]
    try:
        assert main(["dmd", "record", str(folder), "--segment", "boom", *words]) == 0
    finally:
        thread.join()
    capsys.readouterr()
    words[4] = f"{angles}:jaws"
    assert main(["dmd", "record", str(tmp_path / "no"), "--segment", "boom", *words]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "it has no channel 'jaws', it has arm, boom; write STREAM:CHANNEL" in said
    table = pd.read_csv(folder / "boom.csv")
    assert sorted(table.groupby("run").signal.last()) == sorted([*levels, 0])
    assert len(pd.read_csv(folder / "raw" / "boom.csv")) == 2 * len(rows)
    angle = table.groupby("run").angle_deg.last().to_numpy()
    assert angle.max() == pytest.approx(max(a for _, u, a in rows if u), abs=1e-4)


def test_without_the_reader_of_dbc_files_a_bus_is_refused_before_anything_is_recorded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "cantools", None)
    words = ["--segment", "boom", "--signal", "1", "--angle", "a.b", "--bus", "nothing:there"]
    assert main(["dmd", "record", str(tmp_path / "kept"), *words]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "messages of a CAN bus needs cantools, which is not installed: pip install" in said
    assert not (tmp_path / "kept").exists()
