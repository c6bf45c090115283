"""What a simulated study costs beside bare PyBullet ticks, on one core, on two, and in memory.

    python -m benchmarks.cohort [--participants 36]

Every participant of the aiming study is simulated and consolidated; after each, the engine alone
makes as many ticks: four motors set, one step, four joints read, with the settings that a crane
needs by itself (200 solver passes, no residual threshold, limits of 1e7 N m), and with the 400
passes that labcrane's crane is given. Times of one core are the process's own.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.table import Row, show
from labcrane.registry import discover
from labcrane.simulation import SimulationOrder, simulate
from labcrane.study import Study, load

AIMING = Path(__file__).parents[1] / "protocols" / "aiming" / "protocol.yaml"
PASSES = (200, 400)


def rows(participants: int = 36) -> list[Row]:
    """Return all figures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found = one_core(folder, participants)
        found.append(two_cores(folder, max(participants // 3, 4)))
        found.append(memory(folder, max(participants // 9, 2)))
    return found


def one_core(folder: Path, participants: int) -> list[Row]:
    """Simulate everybody here, with bare ticks in between."""
    study = load(AIMING, discover())
    ours, ticks = 0.0, 0
    bare = dict.fromkeys(PASSES, 0.0)
    for number in range(1, participants + 1):
        order = SimulationOrder(AIMING, None, folder / "one", f"P{number:03}")
        began = time.process_time()
        simulate(order)
        ours += time.process_time() - began
        count = recorded(order.folder.participant_file)
        ticks += count
        for passes in PASSES:
            bare[passes] += bare_s(study, folder, passes, count)
    goals = {200: 1.5, 400: None}
    return [
        Row(
            "cohort",
            f"{participants} participants, {ticks} ticks, us per tick",
            1e6 * ours / ticks,
            1e6 * bare[passes] / ticks,
            f"bare PyBullet, {passes} passes",
            goals[passes],
        )
        for passes in PASSES
    ]


def recorded(path: Path) -> int:
    """Return the ticks in a participant file."""
    import h5py  # noqa: PLC0415 - loads for a second

    with h5py.File(path) as file:
        return len(file["ses-01/time"])


def bare_s(study: Study, folder: Path, passes: int, count: int) -> float:
    """Return the processor's seconds for so many ticks of the engine alone."""
    from labcrane_bullet.engine import pybullet  # noqa: PLC0415
    from labcrane_bullet.urdf import urdf  # noqa: PLC0415

    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setPhysicsEngineParameter(
        fixedTimeStep=1.0 / study.protocol.rate_hz,
        numSolverIterations=passes,
        solverResidualThreshold=0,
        deterministicOverlappingPairs=1,
        physicsClientId=client,
    )
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
    path = folder / "crane.urdf"
    path.write_text(urdf(study.machine))
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE
    body = pybullet.loadURDF(str(path), useFixedBase=True, flags=flags, physicsClientId=client)
    dampings = dict.fromkeys(("linearDamping", "angularDamping", "jointDamping"), 0.0)
    for joint, angle in enumerate(study.machine.rest):
        pybullet.changeDynamics(body, joint, **dampings, physicsClientId=client)
        pybullet.changeDynamics(body, joint, jointLimitForce=1e7, physicsClientId=client)
        pybullet.resetJointState(body, joint, angle, 0.0, physicsClientId=client)
    efforts, joints = [joint.effort for joint in study.machine.joints], [0, 1, 2, 3]
    began = time.process_time()
    for number in range(count):
        speeds = [0.1 if number // 480 % 2 else -0.1] * 4
        pybullet.setJointMotorControlArray(
            body, joints, pybullet.VELOCITY_CONTROL, targetVelocities=speeds, forces=efforts,
            physicsClientId=client,
        )  # fmt: skip
        pybullet.stepSimulation(physicsClientId=client)
        pybullet.getJointStates(body, joints, physicsClientId=client)
    took = time.process_time() - began
    pybullet.disconnect(client)
    return took


COMMAND = """
import json, resource, sys, time
from labcrane.cli.app import main
began = time.perf_counter()
assert main(sys.argv[1:]) == 0
took = time.perf_counter() - began
print(json.dumps([took, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))
"""


def command(folder: Path, participants: int, workers: int) -> tuple[float, float]:
    """Run ``labcrane simulate`` in a process of its own; return its seconds and its MB at most."""
    words = ["simulate", str(AIMING), "--out", str(folder / f"out-{participants}-{workers}")]
    words += ["--participants", str(participants), "--workers", str(workers)]
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, *words], check=True, capture_output=True, text=True
    )
    seconds, megabytes = json.loads(done.stdout.splitlines()[-1])
    return seconds, megabytes


def two_cores(folder: Path, participants: int) -> Row:
    """Compare two workers with one."""
    two, one = (command(folder, participants, workers)[0] for workers in (2, 1))
    what = f"{participants} participants with two workers, s"
    return Row("cohort", what, two, one, "with one", 1 / 1.8)


def memory(folder: Path, few: int) -> Row:
    """Compare the memory for few participants and for three times as many."""
    small, large = (command(folder / "memory", count, 1)[1] for count in (few, 3 * few))
    return Row("cohort", f"{3 * few} participants, MB at most", large, small, f"{few} of them", 1.1)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--participants", type=int, default=36)
    show(rows(parser.parse_args().participants))
