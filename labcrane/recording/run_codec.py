"""A run in a form that can be sent to other processes."""

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from labcrane.core.records import Run
from labcrane.core.signals import Layout, Signal
from labcrane.errors import PluginError
from labcrane.machines.machine import Body, Machine
from labcrane.machines.mesh import read_mesh, write_mesh
from labcrane.types import FloatArray


def write_run(run: Run) -> str:
    """Return what does not change in a session's context, as JSON."""
    layouts = {"axes": run.axes, "command": run.command, "state": run.state, "task": run.task}
    return json.dumps(
        {
            "rate_hz": run.rate_hz,
            "seed": run.participant_seed,
            "machine": run.machine.model_dump(mode="json"),
            "layouts": {part: asdict(layout) for part, layout in layouts.items()},
            "bodies": [_fields(body) for body in run.bodies],
        }
    )


def read_run(text: str) -> Run:
    """Return the run that :func:`write_run` wrote, with nobody to steer."""
    found = json.loads(text)
    layouts = {part: _layout(layout) for part, layout in found["layouts"].items()}
    return Run(
        rate_hz=found["rate_hz"],
        machine=Machine.model_validate(found["machine"]),
        participant_seed=found["seed"],
        inverse=_nobody,
        bodies=tuple(_body(body) for body in found["bodies"]),
        **layouts,
    )


def _layout(found: Mapping[str, Any]) -> Layout:
    signals = (
        Signal(each["name"], each["unit"], tuple(each["components"])) for each in found["signals"]
    )
    return Layout(found["owner"], tuple(signals))


def _fields(body: Body) -> dict[str, Any]:
    return {**asdict(replace(body, mesh=None)), "mesh": write_mesh(body.mesh)}


def _body(found: Mapping[str, Any]) -> Body:
    tuples = {name: tuple(found[name]) for name in ("size", "centre")}
    return Body(**{**found, **tuples, "mesh": read_mesh(found["mesh"])})


def _nobody(velocity: FloatArray, state: FloatArray) -> FloatArray:
    raise PluginError("feedback was asked to steer; only the session's process can do that")
