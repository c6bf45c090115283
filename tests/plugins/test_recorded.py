"""The recorded input: what was done once is done again."""

from pathlib import Path

import numpy as np
import pytest
from cranes import needs_mujoco
from rehearsal import SHORT, ScriptedConsole, a_study, rehearse

from labcrane import InputDevice, ProtocolError, open_recording
from labcrane.protocol.rig import Rig
from labcrane.testing import InputContract, Visit, ch8, run
from labcrane_operator import labcrane_inputs
from labcrane_operator.recorded import RecordedSettings

ENGINED = SHORT.replace("kinematic_crane", "mujoco_crane")

pytestmark = needs_mujoco


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded")
    visit = Visit(a_study(folder, ENGINED), "P001", 1, folder / "data", simulated=True, fast=True)
    return run(visit, ScriptedConsole())


class TestContract(InputContract):
    @pytest.fixture
    def device(self, recording: Path) -> InputDevice:
        offer = {offer.name: offer for offer in labcrane_inputs()}["recorded"]
        return offer.build(RecordedSettings(file=recording), ch8())


def test_the_same_axes_move_the_machine_the_same_way(recording: Path, tmp_path: Path) -> None:
    text = ENGINED.replace("{use: dual_joystick}", f"{{use: recorded, file: {recording}}}")
    study = a_study(tmp_path, text)
    seen = rehearse(study, rig=Rig.build(study, simulated=False))
    state = open_recording(recording).session(1).streams["state"].data.to_numpy()
    np.testing.assert_array_equal([frame.state for frame in seen.frames], state)


def test_a_recording_that_ends_early_is_lost_input(recording: Path, tmp_path: Path) -> None:
    text = ENGINED.replace("{use: dual_joystick}", f"{{use: recorded, file: {recording}}}")
    study = a_study(
        tmp_path, text.replace("pairs: 1", "pairs: 2") + "on_fault: {input_lost: end}\n"
    )
    seen = rehearse(study, rig=Rig.build(study, simulated=False))
    assert "has ended" in seen.events("input.lost")[0].data["why"]
    assert seen.events("session.end")[0].data["reason"] == "input lost"


def test_a_recording_of_another_rate_is_refused(recording: Path, tmp_path: Path) -> None:
    text = ENGINED.replace("{use: dual_joystick}", f"{{use: recorded, file: {recording}}}")
    study = a_study(tmp_path, text.replace("rate_hz: 240", "rate_hz: 250"))
    with pytest.raises(ProtocolError, match="recorded at 240 Hz and cannot be played at 250 Hz"):
        rehearse(study, rig=Rig.build(study, simulated=False))


def test_a_recording_that_is_not_there_is_told() -> None:
    offer = {offer.name: offer for offer in labcrane_inputs()}["recorded"]
    with pytest.raises(ProtocolError, match=r"there is no participant file nowhere\.h5"):
        offer.build(RecordedSettings(file="nowhere.h5"), ch8())
