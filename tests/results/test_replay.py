"""A recorded session run again."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cranes import engines
from rehearsal import SHORT, a_study

import labcrane
from labcrane import Frame, ProtocolError, RecordingError, open_recording
from labcrane.analysis.measures import measure_session
from labcrane.recording import Stream
from labcrane.replay import replay_session
from labcrane.replay.restore import restored_study
from labcrane.session.commands import StreamBack, StreamLost
from labcrane.testing import Command, Order, main
from results.recorded import STUDY, record, study

ROOT = Path(__file__).parents[2]
CH8 = Path(labcrane.__file__).parent / "machines" / "data" / "ch8.yaml"


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("replay")
    return record(study(root), root / "data", "P001", simulated=True)


def changed_machine(folder: Path) -> Path:
    path = folder / "faster.yaml"
    path.write_text(
        CH8.read_text(encoding="utf-8").replace("speed_deg_s: 26,", "speed_deg_s: 26.5,"),
        encoding="utf-8",
    )
    return path


@pytest.mark.slow
@engines
def test_a_whole_session_on_an_engine_is_bit_identical(tmp_path: Path, name: str) -> None:
    """The aiming study itself: each of its eight pairs of circles, once."""
    text = (ROOT / "protocols" / "aiming" / "protocol.yaml").read_text(encoding="utf-8")
    (tmp_path / "instructions.md").write_text("Move.", encoding="utf-8")
    quick = "{use: simulated_operator, fitts_a_s: 0.3, fitts_b_s: 0.8, look_s: 0.1}"
    text = text.replace("scheme:", f"operator: {quick}\nscheme:", 1)
    text = text.replace("movements: 4,", "movements: 1,").replace("mujoco_crane", name)
    path = record(a_study(tmp_path, text), tmp_path / "data", "P001", simulated=True)
    session = open_recording(path).session(1)
    assert len(session.trials) == 8
    again = replay_session(path, 1)
    assert again.difference is None
    assert again.parts == ()
    assert again.ticks == len(session.streams["state"].time)


def test_a_changed_machine_is_named_with_the_first_tick_that_differs(
    path: Path, tmp_path: Path
) -> None:
    again = replay_session(path, 1, machine=changed_machine(tmp_path))
    assert again.parts == ("machine.joints.slew.speed_deg_s: recorded 26, now 26.5",)
    first = again.difference
    assert first is not None
    session = open_recording(path).session(1)
    before = again.frames["command"].iloc[: first.tick].to_numpy()
    np.testing.assert_array_equal(
        before, session.streams["command"].data.iloc[: first.tick].to_numpy()
    )
    column = first.column.removeprefix("command.")
    assert first.recorded == session.streams["command"].data[column][first.tick]
    # The slew's full speed is 26.5 / 26 of what it was, and the difference is no more than that.
    assert first.replayed / first.recorded == pytest.approx(26.5 / 26.0, rel=1e-3)


def test_a_changed_setting_is_named(path: Path, tmp_path: Path) -> None:
    other = tmp_path / "study.yaml"
    other.write_text(
        STUDY.replace("joint_velocity\n", "joint_velocity\n  dead_zone: 0.2\n"), encoding="utf-8"
    )
    again = replay_session(path, 1, protocol=other)
    assert any(part.startswith("scheme.settings.dead_zone: recorded") for part in again.parts)
    assert again.difference is not None


def test_another_version_is_named(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from labcrane.replay import restore as replay_parts

    real = replay_parts.version
    monkeypatch.setattr(
        replay_parts, "version", lambda name: "0.0.9" if name == "numpy" else real(name)
    )
    again = replay_session(path, 1)
    assert again.parts == (f"numpy: recorded with {np.__version__}, now 0.0.9",)
    assert again.difference is None


SWITCHED = (
    "  use: switchable\n  button: left.trigger\n  start: end_effector\n"
    "  joint_velocity: {map: {slew: -left.x, elbow: left.y, wrist: -right.x, "
    "shoulder: -right.y}}\n  end_effector: {map: {x: -left.y, y: -left.x, z: right.y}}\n"
)


def test_defaults_are_those_of_the_recording(tmp_path: Path) -> None:
    """Now that of the study's targets; 0.5 m/s where that is what is recorded."""
    whole = SHORT[: SHORT.index("scheme:\n") + 8] + SWITCHED + SHORT[SHORT.index("dynamics:") :]
    path = record(a_study(tmp_path, whole), tmp_path / "data", "P001", simulated=True)
    again = replay_session(path, 1)
    assert (again.difference, again.parts) == (None, ())
    session = open_recording(path).session(1)
    settings = session.context["components"]["scheme"]["settings"]
    assert (settings["ramp_s"], settings["end_effector"]["speed_m_s"]) == (0.5, None)
    settings["end_effector"]["speed_m_s"] = 0.5
    scheme = restored_study(session, tmp_path).scheme.settings.model_dump()
    assert (scheme["ramp_s"], scheme["end_effector"]["speed_m_s"]) == (0.5, 0.5)


def test_what_was_not_recorded_then_is_named_and_all_else_is_compared(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the loads of joints, which recordings of before have not."""
    whole = Stream.data.func

    def former(stream: Stream) -> pd.DataFrame:
        table = whole(stream)
        return table.drop(columns=[name for name in table if name.startswith("tip.velocity.")])

    monkeypatch.setattr(Stream, "data", property(former))
    again = replay_session(path, 1)
    assert again.difference is None
    assert again.parts == tuple(
        f"state.tip.velocity.{axis}: not recorded, now there" for axis in "xyz"
    )
    assert replay_session(path, 1, machine=changed_machine(path.parent)).difference is not None


def test_orders_are_given_again_at_their_ticks(tmp_path: Path) -> None:
    orders = {
        300: [Command(Order.PAUSE)],
        420: [Command(Order.START)],
        600: [Command(Order.REPEAT)],
        900: [Command(Order.SKIP), Command(Order.NOTE, "coughs")],
        1500: [StreamLost("eeg")],
        1600: [StreamBack("eeg")],
        4000: [Command(Order.END)],
    }
    path = record(study(tmp_path), tmp_path / "data", "P001", simulated=True, orders=orders)
    events = open_recording(path).session(1).events["name"].tolist()
    assert {"order.pause", "order.repeat", "stream.lost", "stream.back"} <= set(events)
    again = replay_session(path, 1)
    assert again.difference is None
    assert again.ticks == 4001


@pytest.mark.slow
def test_lost_controls_are_lost_again(tmp_path: Path) -> None:
    """A recorded session as input ends, which is a fault of the controls, and then an end."""
    first = record(study(tmp_path), tmp_path / "data", "P001", simulated=True)
    text = STUDY.replace(
        "operator: {use: simulated_operator, pace_sd: 0.2, fitts_a_s: 0.6, fitts_b_s: 1.2}",
        f"operator: {{use: recorded, file: {first}}}\non_fault: {{input_lost: end}}",
    ).replace("movements: 2}", "movements: 4}")
    second = record(a_study(tmp_path, text), tmp_path / "more", "P001", simulated=True)
    events = open_recording(second).session(1).events["name"].tolist()
    assert "input.lost" in events
    assert replay_session(second, 1).difference is None


def test_measures_that_nobody_thought_of_are_taken_from_the_frames(path: Path) -> None:
    heights: list[float] = []

    def look(frame: Frame) -> None:
        heights.append(float(frame.state[10]))

    again = replay_session(path, 1, sinks=[look])
    assert len(heights) == again.ticks
    session = open_recording(path).session(1)
    np.testing.assert_array_equal(heights, session.streams["state"].data["tip.position.z"])
    recorded, replayed = measure_session(session), measure_session(session, frames=again.frames)
    assert recorded.equals(replayed)


def test_the_command_says_what_came_of_it(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "measures.csv"
    assert main(["replay", str(path), "--session", "1", "--measures", str(table)]) == 0
    said = capsys.readouterr().out
    assert "every number the same bit for bit" in said
    assert table.read_text(encoding="utf-8").count("\n") == 9
    machine = str(changed_machine(tmp_path))
    assert main(["replay", str(path), "--machine", machine]) == 1
    out, err = capsys.readouterr()
    assert "differs: machine.joints.slew.speed_deg_s: recorded 26, now 26.5" in out
    assert "is the first that differs: command.command.slew was" in err


def test_what_cannot_be_replayed_is_refused(path: Path) -> None:
    with pytest.raises(RecordingError, match="has no session 2; it has 1"):
        replay_session(path, 2)
    with pytest.raises(ProtocolError, match="a speed of 0 shows nothing; give one above 0"):
        replay_session(path, 1, speed=0.0)


@pytest.mark.slow
def test_a_replay_is_shown_on_the_streams_at_a_speed(path: Path) -> None:
    import threading
    import time

    import pylsl

    got: list[float] = []

    def watch() -> None:
        (info,) = pylsl.resolve_byprop("name", "labcrane.state", 1, 240.0)
        inlet = pylsl.StreamInlet(info)
        while len(got) < 3:
            sample, _ = inlet.pull_sample(timeout=240.0)
            if sample is None:
                return
            got.append(sample[0])

    watcher = threading.Thread(target=watch)
    watcher.start()
    began = time.perf_counter()
    again = replay_session(path, 1, speed=10.0)
    took = time.perf_counter() - began
    watcher.join()
    assert len(got) == 3
    assert again.difference is None
    assert took >= (again.ticks - 1) / 120.0 / 10.0
