"""An arm that moves by a Dynamic Model Description, among things that it can touch."""

from collections.abc import Mapping, Sequence
from importlib.metadata import version

from labcrane import Dynamics, FloatArray, Machine, PluginError, ProtocolError, Run, Trial
from labcrane.core import Value
from labcrane.machines import Body, PlacedObject, load_scene, place_objects
from labcrane_dmd.arm.contacts import ContactWindow
from labcrane_dmd.arm.drive import drives
from labcrane_dmd.arm.overload import overloads
from labcrane_dmd.arm.settings import ArmSettings
from labcrane_dmd.arm.state import ArmState, arm_signals, scene_parts
from labcrane_dmd.arm.urdf import link_names
from labcrane_dmd.arm.visual import boxes
from labcrane_dmd.arm.world import World
from labcrane_dmd.model.interpolation import FULL
from labcrane_dmd.model.model import Model
from labcrane_dmd.model.model_file import load

ROUNDING_S = 1e-9

SLACK_RAD = 2e-3
"""Maximum by which the engine may let a joint exceed its limit; more is an error."""


class DmdArm(Dynamics):
    """Joints whose valves give the speeds of a model, with drives of limited force behind them.

    Takes ``valve.signal`` from the scheme, or where that is missing its ``command`` as a share of
    the machine's joint speeds. Every reset restarts the engine, because setting joints by hand
    leaves contact caches behind.
    """

    def __init__(self, settings: ArmSettings, machine: Machine, model: Model | None = None) -> None:
        self._settings = settings
        self._machine = machine
        self._model = model or load(settings.model)
        self._scenes = {path.name.split(".")[0]: load_scene(path) for path in settings.scenes}
        self._parts = scene_parts(self._scenes.values())
        links = link_names(machine, settings.jaws)
        self.signals = arm_signals(machine, self._parts, links)
        self._state = ArmState(machine, self._parts, links)
        given = settings.proportional_valve
        self._valve = given.numbers if given else None
        drives(self._model, settings.proportional, machine, 1.0)  # complains before anything opens
        settings.check_jaws(machine)
        self._world: World | None = None
        self._trial: Trial | None = None

    def open(self, run: Run) -> None:
        names = [signal.name for signal in run.command.signals]
        self._in_signals = "valve.signal" in names
        self._drive = run.command.find("valve.signal" if self._in_signals else "command")
        asked, there = self._drive.stop - self._drive.start, len(self._machine.joints)
        if asked != there:
            raise ProtocolError(
                f"{run.command.owner} commands {asked} joints; this machine has {there} "
                f"({', '.join(self._machine.names)})"
            )
        self._dt = 1.0 / run.rate_hz
        settings = self._settings
        self._drives = drives(
            self._model, settings.proportional, self._machine, self._dt, self._valve
        )
        self._overloads = overloads(there, settings.overload, self._dt)
        # Jaws press until they stall: that is their work, and no overload.
        self._press = there - 1 if settings.jaws else -1
        self._pose = list(self._machine.rest)
        self.reset(self._machine.rest)

    def begin_trial(self, trial: Trial) -> None:
        self._trial = trial
        # A start pose has its own reset; until then the arm may overlap the new scene.
        if self._scenes and trial.planned.start_pose is None:
            self.reset(self._pose)

    def state(self) -> FloatArray:
        return self._state.values

    def step(self, command: FloatArray, dt: float) -> FloatArray:
        if abs(dt - self._dt) > ROUNDING_S:
            raise PluginError(
                f"a step of {dt:g} s was asked for; the arm was opened for ticks of "
                f"{self._dt:g} s and cannot change them while it runs"
            )
        world = self._opened()
        signals = command[self._drive].tolist()
        if not self._in_signals:
            signals = [
                max(-FULL, min(FULL, FULL * speed / full))  # rounding can be beyond by a bit
                for speed, full in zip(signals, self._machine.speeds, strict=True)
            ]
        speeds = [
            drive.speed(signal, angle)
            for drive, signal, angle in zip(self._drives, signals, self._pose, strict=True)
        ]
        stopped = self._stop_at_ends(speeds)
        angles, moved, loads = world.step(speeds)
        for joint, push in stopped:
            loads[joint] = push
        loads = [window.add(load) for window, load in zip(self._loads, loads, strict=True)]
        over = [
            0
            if joint == self._press
            else watch.see(load, driven=abs(drive.signal) > 0.0 or watch.direction != 0)
            for joint, (watch, load, drive) in enumerate(
                zip(self._overloads, loads, self._drives, strict=True)
            )
        ]
        self._pose = angles
        openings = [drive.signal for drive in self._drives]
        return self._state.fill(angles, moved, loads, over, openings, world)

    def reset(self, pose: Sequence[float]) -> None:
        angles = self._checked(pose)
        for drive in self._drives:
            drive.reset()
        for watch in self._overloads:
            watch.reset()
        # Averaged like forces: the tick in which a drive starts its joint is not an overload.
        ticks = max(1, round(self._settings.window_s / self._dt))
        self._loads = [ContactWindow(ticks) for _ in angles]
        self._disconnect()
        self._world = World(self._settings, self._machine, self._dt, angles, self._standing())
        self._pose = angles
        rest = [0.0] * len(angles)
        self._state.fill(angles, rest, rest, [0] * len(angles), rest, self._world)

    def bodies(self) -> Sequence[Body]:
        return boxes(self._machine, self._settings.jaws)

    def metadata(self) -> Mapping[str, Value]:
        return {
            "engine": f"pybullet {version('pybullet')}",
            "model": self._settings.model.name,
            "model.between": self._model.settings.between,
            **{f"model.{name}.sha256": each.sha256 for name, each in self._model.sources.items()},
        }

    def close(self) -> None:
        self._disconnect()

    def _stop_at_ends(self, speeds: list[float]) -> list[tuple[int, float]]:
        """Keep joints within their ranges; return those that are driven against an end, and where.

        A cylinder at its end is held by its own housing, and its valve works against the relief:
        full load, whatever hangs on the joint. The engine's own limits give way (bullet3 #2944).
        """
        found = []
        for joint, (lowest, highest) in enumerate(self._machine.limits):
            angle, speed = self._pose[joint], speeds[joint]
            ahead = angle + speed * self._dt
            if (speed > 0.0 and ahead > highest) or (speed < 0.0 and ahead < lowest):
                found.append((joint, 1.0 if speed > 0.0 else -1.0))
            if not lowest <= ahead <= highest:
                speeds[joint] = ((highest if ahead > highest else lowest) - angle) / self._dt
        return found

    def _standing(self) -> tuple[PlacedObject, ...]:
        if self._trial is None or not self._scenes:
            return ()
        name = self._trial.planned.condition.get("scenario")
        if name not in self._scenes:
            raise ProtocolError(
                f"the trial is in scene {name!r}; dynamics has {', '.join(self._scenes)}: list the "
                "same scene files under dynamics and task"
            )
        return place_objects(self._scenes[str(name)], self._trial.seed)

    def _checked(self, pose: Sequence[float]) -> list[float]:
        angles = [float(angle) for angle in pose]
        if len(angles) != len(self._machine.joints):
            raise ProtocolError(
                f"a pose of {len(angles)} angles was asked for; this machine has "
                f"{len(self._machine.joints)} joints ({', '.join(self._machine.names)})"
            )
        for number, (joint, angle) in enumerate(zip(self._machine.joints, angles, strict=True)):
            lowest, highest = joint.limits
            if not lowest - SLACK_RAD <= angle <= highest + SLACK_RAD:
                raise ProtocolError(
                    f"a pose with {joint.name} at {angle:.4f} rad was asked for; it goes from "
                    f"{lowest:.4f} to {highest:.4f}"
                )
            angles[number] = min(max(angle, lowest), highest)
        return angles

    def _opened(self) -> World:
        if self._world is None:
            raise PluginError("the arm was asked to move before it was opened")
        return self._world

    def _disconnect(self) -> None:
        if self._world is not None:
            self._world.close()
            self._world = None
