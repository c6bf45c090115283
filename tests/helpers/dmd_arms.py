"""The arm of the retrieval study, standing in a scene."""

import shutil
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np

from labcrane import Dynamics, Signal
from labcrane.core import PlannedTrial
from labcrane.machines import load_machine
from labcrane.testing import RATE_HZ, make_run, make_trial
from labcrane_dmd import labcrane_dynamics
from labcrane_dmd.arm.settings import ArmSettings, JawsSettings

RETRIEVAL = Path(__file__).parents[2] / "protocols" / "retrieval"
MODEL = RETRIEVAL / "arm.dmd.yaml"
MAP = {"slew": "left.x", "shoulder": "left.y", "elbow": "right.x", "wrist": "-right.y"}


def with_files(folder: Path) -> Path:
    """Put machine, model and scenes of the retrieval study beside a protocol of a test's own."""
    for name in ("ied_arm.yaml", MODEL.name):
        shutil.copy(RETRIEVAL / name, folder)
    shutil.copytree(RETRIEVAL / "scenes", folder / "scenes", dirs_exist_ok=True)
    return folder


def build(machine=None, **settings) -> Dynamics:
    (offered,) = labcrane_dynamics()
    machine = machine or load_machine("ied_arm.yaml", RETRIEVAL)
    given = {"model": MODEL, "proportional": ("base",), "jaws": JawsSettings()} | settings
    return offered.build(ArmSettings.model_validate(given), machine)


@contextmanager
def standing(scene: str | None = None, folder: Path | None = None, **settings) -> Iterator:
    """Yield an open arm in a scene, and what finds things in its state."""
    machine = load_machine("ied_arm.yaml", RETRIEVAL)
    if scene is not None and folder is not None:
        (folder / "scene.yaml").write_text(scene, encoding="utf-8")
        settings["scenes"] = (folder / "scene.yaml",)
    arm = build(machine, **settings)
    signal = Signal("valve.signal", "1", machine.names)
    run = make_run(machine, command=(signal,), state=arm.signals)
    with closing(arm):
        arm.open(run)
        if scene is not None:
            arm.begin_trial(make_trial(PlannedTrial({"scenario": "scene"}, expected_s=1.0)))
        yield arm, run.state


def step(arm: Dynamics, seconds: float, /, **signals: float) -> np.ndarray:
    """Hold signals; return the state after every tick."""
    order = ("base", "arm", "boom", "jaws")
    command = np.array([signals.get(name, 0.0) for name in order])
    return np.array(
        [arm.step(command, 1 / RATE_HZ).copy() for _ in range(round(seconds * RATE_HZ))]
    )
