"""A panel on a CAN bus that goes wrong in a session: nothing moves until it is well again."""

import math
import struct
from pathlib import Path

import can
import numpy as np
import pytest
from rehearsal import a_study

from labcrane import open_recording
from labcrane.session.session import finish, record
from labcrane.testing import Command, Order, Visit
from labcrane_can.command_state import PanelCommands

JOINTS = ("slew", "shoulder", "elbow", "wrist")
SIGNALS = "".join(
    f"BO_ {256 + number // 2} Levers{number // 2}: 8 P\n"
    f' SG_ Even : 0|32@1- (1,0) [-100|100] "%" P\n SG_ Odd : 32|32@1- (1,0) [-100|100] "%" P\n\n'
    for number in (0, 2)
)
TYPES = "".join(f"SIG_VALTYPE_ {at} {name} : 1;\n" for at in (256, 257) for name in ("Even", "Odd"))
DBC = f'VERSION ""\nNS_ :\nBS_:\nBU_: P\n\n{SIGNALS}{TYPES}'
STUDY = """\
labcrane: 1
study: can-fault
title: A panel that goes wrong
rate_hz: 240
machine: ch8
input:
  use: can
  bus: virtual:canfault
  map: {map}
  valves: {{slew: Levers0.Even, shoulder: Levers0.Odd, elbow: Levers1.Even, wrist: Levers1.Odd}}
scheme:
  use: joint_velocity
  map: {{slew: valve.slew, shoulder: valve.shoulder, elbow: valve.elbow, wrist: valve.wrist}}
dynamics: {{use: kinematic_crane}}
tasks:
  aiming: {{use: aiming, distances: [2], movements: 2, limit_s: 60}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming, pairs: 1}}
"""
TAKE = PanelCommands.take
BROKEN, WELL, OVER = 240, 480, 720


def levers(at: int, *values: float) -> can.Message:
    data = struct.pack("<2f", *values)
    return can.Message(arbitration_id=at, is_extended_id=False, data=data)


class Room:
    """Somebody who starts the block, and a panel that is broken from one tick to another."""

    def __init__(self, bus: can.BusABC, monkeypatch: pytest.MonkeyPatch, how: float | None) -> None:
        self._bus, self._monkeypatch, self._how = bus, monkeypatch, how
        self.tick = -1
        self._start = False

    def report(self, event) -> None:
        # A fault holds the session until the panel is heard, and nothing is started meanwhile.
        self._start |= event.name in {"waiting", "pause.end"}

    def commands(self) -> list[Command]:
        self.tick += 1
        broken = BROKEN <= self.tick < WELL
        first = 40.0
        if broken and self._how is None:
            self._monkeypatch.setattr(PanelCommands, "take", nobody_has_thought_of_this)
        elif broken:
            first = self._how
        else:
            self._monkeypatch.setattr(PanelCommands, "take", TAKE)
        self._bus.send(levers(256, first, 40.0))
        self._bus.send(levers(257, 40.0, 40.0))
        start, self._start = self._start, False
        return [Command(Order.START)] * start + [Command(Order.END)] * (self.tick == OVER)


def nobody_has_thought_of_this(*_: object) -> None:
    raise ZeroDivisionError("nobody has thought of this")


@pytest.mark.slow
@pytest.mark.parametrize("how", [math.nan, None], ids=str)
def test_a_panel_that_goes_wrong_moves_nothing_and_pauses_until_it_is_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: float | None
) -> None:
    (tmp_path / "panel.dbc").write_text(DBC)
    study = a_study(tmp_path, STUDY.format(map="panel.dbc"))
    visit = Visit(study, "P001", 1, tmp_path / "data", pilot=True)
    with can.Bus(interface="virtual", channel="canfault") as bus:
        record(visit, Room(bus, monkeypatch, how))
    finish(visit)
    session = open_recording(visit.folder.participant_file).session(1)
    command = session.streams["command"].data.iloc[:, :4].to_numpy()
    paused = session.streams["loop"].data["paused"].to_numpy() == 1.0
    np.testing.assert_array_equal(session.streams["loop"].data["tick"], np.arange(len(paused)))
    moving = np.flatnonzero(command.any(axis=1))
    assert len(moving[moving < BROKEN]) > 60, "it moved before"
    assert len(moving[moving > WELL]) > 60, "and afterwards"
    # One reading of the bus later at most, which is a thread's: some ticks on a busy computer.
    still = np.flatnonzero(~command.any(axis=1) & paused)
    first = still[still >= BROKEN][0]
    between = slice(first, WELL)
    assert not command[between].any()
    assert paused[between].all()
    assert first - BROKEN < (WELL - BROKEN) / 2
    events = session.events
    held = events[(events["name"] == "pause.start") & (events["tick"] >= BROKEN)]
    assert [data["by"] for data in held["data"]] == ["input"], "once, not again and again"
