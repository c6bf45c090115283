"""A run in a form that can be sent to other processes."""

import json
from dataclasses import dataclass
from functools import cache

from pydantic import TypeAdapter

from labcrane.core.primitives import Sphere
from labcrane.core.records import Run
from labcrane.core.signals import Layout
from labcrane.errors import PluginError
from labcrane.machines.machine import Body, Machine
from labcrane.types import FloatArray


@dataclass(frozen=True)
class RunScene:
    """The constant part of a session's context."""

    rate_hz: float
    seed: int
    machine: Machine
    layouts: dict[str, Layout]
    bodies: tuple[Body, ...]
    places: tuple[Sphere, ...] = ()


@cache
def _codec() -> TypeAdapter[RunScene]:
    return TypeAdapter(RunScene)


def write_run(run: Run) -> str:
    """Return the constant part of a session's context, as JSON."""
    layouts = {"axes": run.axes, "command": run.command, "state": run.state, "task": run.task}
    scene = RunScene(
        run.rate_hz, run.participant_seed, run.machine, layouts, run.bodies, run.places
    )
    return json.dumps(_codec().dump_python(scene, mode="json"))


def read_run(text: str) -> Run:
    """Return the run that :func:`write_run` wrote, without control of the session."""
    found = _codec().validate_json(text)
    return Run(
        rate_hz=found.rate_hz,
        machine=found.machine,
        participant_seed=found.seed,
        inverse=_nobody,
        bodies=found.bodies,
        places=found.places,
        **found.layouts,
    )


def _nobody(velocity: FloatArray, state: FloatArray) -> FloatArray:
    raise PluginError("feedback was asked to steer; only the session's process can do that")
