"""Metadata written at the start of a recording, for its readers."""

import hashlib
import platform
import sys
from dataclasses import asdict
from datetime import UTC, datetime
from functools import lru_cache
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

from labcrane.core.records import Run
from labcrane.core.roles import Questionnaire
from labcrane.design.plan import SessionPlan
from labcrane.doctor.checks import at_start
from labcrane.protocol.components import ComponentSpec
from labcrane.protocol.referenced_files import named_files
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study
from labcrane.recording.trial_columns import trial_definitions, trial_units
from labcrane.registry.entry_points import entry_points_of
from labcrane.registry.hookspecs import PROJECT
from labcrane.registry.loader import own_plugins
from labcrane.session.visit import Visit

RECORDED_PACKAGES = (
    "labcrane",
    "mujoco",
    "numpy",
    "panda3d",
    "pybullet",
    "pydantic",
    "pygame",
    "pylsl",
    "pyo",
)


def context(visit: Visit, plan: SessionPlan, rig: Rig, run: Run) -> dict[str, Any]:
    """Return everything that readers of the recording must know, ready for JSON.

    ``plan`` is the plan of the whole session, also where the session is resumed.
    """
    return {
        **_of_visit(visit, plan),
        "rate_hz": run.rate_hz,
        **_of_study(visit.study, simulated=visit.simulated),
        "facts": rig.metadata(),
        "versions": dict(_versions(tuple(sys.path))),
        # What a simulation records does not depend on the computer that it is made on.
        "doctor": None if visit.fast else at_start(visit.folder.root),
        "plan": [
            {
                "block": block.number,
                "name": block.name,
                "trials": len(block.trials),
                "practice": block.practice,
                "counted": [one.number for one in block.trials if one.planned.counted],
            }
            for block in plan.blocks
        ],
        **_of_tracks(plan),
        **_of_outcomes(visit.study),
    }


def _of_tracks(plan: SessionPlan) -> dict[str, Any]:
    """Return by which laws levels are chosen; nothing where none are."""
    tracks = {
        each.track.name: each.track.described for each in plan.blocks if each.track is not None
    }
    return {"tracks": tracks} if tracks else {}


def _of_outcomes(study: Study) -> dict[str, Any]:
    """Return the primary outcomes; nothing where the protocol names none."""
    return {"primary": list(study.protocol.design.primary)} if study.protocol.design.primary else {}


def _of_visit(visit: Visit, plan: SessionPlan) -> dict[str, Any]:
    """Return who and when this is, and whether it counts."""
    return {
        "study": visit.study.protocol.study,
        "title": visit.study.protocol.title,
        "participant": visit.folder.name,
        "session": visit.session,
        "session_name": plan.name,
        "started": _started(visit).isoformat(timespec="milliseconds"),
        "simulated": visit.simulated,
        "fast": visit.fast,
        "pilot": visit.pilot,
        "resumed": visit.resumed,
        "sets_back": True,
        "clock": "manual" if visit.fast else "lsl",
        "seed": plan.seed,
        "slot": plan.slot,
        "group": plan.group,
        **_of_judgement(visit),
    }


def _of_judgement(visit: Visit) -> dict[str, Any]:
    """Return whether tests wait to be judged: with an experimenter and an indicator.

    Without a time of reference there is none, and nothing to judge.
    """
    steps = (step for each in visit.study.protocol.sessions for step in each.steps)
    scored = any(step.kind == "reference" for step in steps)
    return {"awaits_judgement": True} if scored and not visit.simulated else {}


def _of_study(study: Study, *, simulated: bool) -> dict[str, Any]:
    """Return the study as it is run: all its parts, and its description of the data."""
    folder = study.path.parent
    choices = {**study.choices} | ({"input": study.operator} if simulated else {})
    return {
        "protocol": study.text,
        "protocol_sha256": study.sha256,
        "machine": study.machine_text,
        "machine_sha256": hashlib.sha256(study.machine_text.encode()).hexdigest(),
        "components": {part: choice.described(folder) for part, choice in choices.items()},
        "files": named_files((choice.settings for choice in choices.values()), folder),
        "own_plugins": {
            name: path.read_text(encoding="utf-8") for name, path in own_plugins(study.path).items()
        },
        "streams": {
            label: need.model_dump(mode="json", exclude_none=True)
            for label, need in study.protocol.streams.items()
        },
        "rights": {name: each.rights for name, each in study.questionnaires.items()},
        "questionnaires": {
            name: _asked(each, study.questionnaire_choices.get(name))
            for name, each in study.questionnaires.items()
        },
        "indicator": study.protocol.indicator.model_dump(mode="json"),
        "sync": study.protocol.sync.model_dump(mode="json"),
        "presented": study.protocol.presented.model_dump(mode="json"),
        "trial_units": {
            column: unit
            for task in study.tasks.values()
            for column, unit in trial_units(task).items()
        },
        "trial_definitions": {
            column: definition
            for task in study.tasks.values()
            for column, definition in trial_definitions(task).items()
        },
    }


def _asked(questionnaire: Questionnaire, choice: ComponentSpec | None) -> dict[str, Any]:
    """Return what a questionnaire asks, in which words, and what it is worth."""
    return {
        "title": questionnaire.title,
        "language": str(getattr(choice.settings, "language", "")) if choice else "",
        "items": [asdict(item) for item in questionnaire.items()],
        "scores": [asdict(score) for score in questionnaire.scores],
    }


def _started(visit: Visit) -> datetime:
    """Return when the session begins: with --fast on the simulation's clock, which starts at 0."""
    return datetime.fromtimestamp(0.0, UTC) if visit.fast else datetime.now(UTC)


@lru_cache(maxsize=1)
def _versions(path: tuple[str, ...]) -> dict[str, str]:
    """Return those of all that can be imported from ``path``: ``sys.path`` as it is now."""
    return {
        "python": platform.python_version(),
        "system": platform.platform(),
        **{name: version(name) for name in RECORDED_PACKAGES if find_spec(name)},
        **{each.dist.name: each.dist.version for each in entry_points_of(PROJECT) if each.dist},
    }
