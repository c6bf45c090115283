"""The codebook: every column that a session records, with its unit and its source."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from labcrane.core.by_estimate import OF_ESTIMATE
from labcrane.core.records import Value
from labcrane.core.signals import Layout, Signal
from labcrane.design.plan import plan_session
from labcrane.files.pseudonyms import pseudonyms
from labcrane.protocol.design import CONDITION
from labcrane.protocol.protocol import ASSIST
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import ESTIMATES, Study
from labcrane.recording.frame_log import LOOP
from labcrane.recording.trial_columns import OWN, trial_definitions, trial_units

CORE = "labcrane"
ABOUT = (
    "trial", "attempt", "block", "block_name", "practice", "reference", "group", CONDITION,
    "feedback", ASSIST, "outcome", "completion", "track_success",
)  # fmt: skip
"""labcrane's own columns of the trial table, in addition to those with units."""

EVENTS = (("time", "s"), ("tick", "1"), ("part", "1"), ("trial", "1"), ("name", ""), ("data", ""))


@dataclass(frozen=True, slots=True)
class CodebookColumn:
    """One column.

    Attributes
    ----------
    table
        Where it is: a group of the participant file.
    name
        Dotted path within the table.
    unit
        SI symbol; "1" when dimensionless, "" for texts.
    source
        Who computes it: labcrane, or a plugin and its component.
    definition
        Its definition, where its name does not give it.
    """

    table: str
    name: str
    unit: str
    source: str
    definition: str = ""


def codebook(study: Study) -> list[CodebookColumn]:
    """Return every column of frames, events and trials; nothing is opened for it."""
    parts = Rig.build(study, simulated=False)
    tasks = {choice.name: choice for choice in study.task_choices.values()}
    task_source = ", ".join(f"{choice.plugin}: {choice.name}" for choice in tasks.values())
    beside = {
        ASSIST: ASSIST,
        **{f"{ESTIMATES}{each}": OF_ESTIMATE + each for each in study.estimates},
    }
    own = {
        f"{columns}.": f"{choice.plugin}: {choice.name}"
        for part, columns in beside.items()
        if (choice := study.choices.get(part))
    }
    found = [CodebookColumn("loop", each.name, each.unit, CORE, each.definition) for each in LOOP]
    for table, component, source in (
        ("input", parts.input, f"{study.input.plugin}: {study.input.name}"),
        ("command", parts.controller, f"{study.scheme.plugin}: {study.scheme.name}"),
        ("state", parts.dynamics, f"{study.dynamics.plugin}: {study.dynamics.name}"),
        ("task", next(iter(study.tasks.values())), task_source),
    ):
        layout = Layout(table, component.signals)
        defined = {name: each.definition for each in component.signals for name in each.columns}
        found += [
            CodebookColumn(
                table,
                name,
                unit,
                next((by for of, by in own.items() if name.startswith(of)), source),
                defined[name],
            )
            for name, unit in zip(layout.columns, layout.units, strict=True)
        ]
    found += [CodebookColumn("events", name, unit, CORE) for name, unit in EVENTS]
    return found + _trials(study)


def _trials(study: Study) -> list[CodebookColumn]:
    found: dict[str, CodebookColumn] = {}
    own = {signal.name: signal for signal in OWN}
    for name in (*ABOUT, *own):
        if _has(study, name):
            known = own.get(name, Signal(name, ""))
            found[name] = CodebookColumn("trials", name, known.unit, CORE, known.definition)
    for name, (task, values) in _conditions(study).items():
        if name in found:
            continue  # labcrane's own, as the condition within participants
        choice = study.task_choices[task]
        source = f"{choice.plugin}: {choice.name}"
        unit = trial_units(study.tasks[task]).get(name, "" if _is_text(values) else "1")
        defined = trial_definitions(study.tasks[task]).get(name, "")
        found[name] = CodebookColumn("trials", name, unit, source, defined)
    means = {
        f"{name}_{value}": study.choices[ESTIMATES + name]
        for name, settings in study.estimates.items()
        for value in settings.values
    }
    second = {f"{name}_": study.choices[f"secondary.{name}"] for name in study.secondary}
    for task, its_choice in study.task_choices.items():
        for signal in study.tasks[task].results:
            for name in signal.columns:
                beside = (by for of, by in second.items() if name.startswith(of))
                choice = means.get(name) or next(beside, its_choice)
                source = f"{choice.plugin}: {choice.name}"
                found[name] = CodebookColumn("trials", name, signal.unit, source, signal.definition)
    return list(found.values())


def _has(study: Study, name: str) -> bool:
    """Whether sessions of ``study`` have a column that not every study has."""
    protocol = study.protocol
    steps = [step for session in protocol.sessions for step in session.steps]
    given = {
        "group": bool(protocol.design.groups),
        CONDITION: any(step.block is not None and step.block.condition for step in steps),
        "feedback": bool(protocol.switched),
        ASSIST: any(
            protocol.design.tracks[step.block.track].factor == ASSIST
            for step in steps
            if step.block is not None and step.block.track
        ),
        **dict.fromkeys(
            ("track", "track_level", "track_success"),
            any(step.block is not None and step.block.track for step in steps),
        ),
        "reference": any(step.kind == "reference" for step in steps),
    }
    return given.get(name, True)


def _conditions(study: Study) -> dict[str, tuple[str, list[Value]]]:
    """Return the varied factors with all their values, in one participant's plan."""
    (someone,) = pseudonyms(study.protocol.participants.pattern, 1)
    found: dict[str, tuple[str, list[Value]]] = {}
    for number in range(1, len(study.protocol.sessions) + 1):
        for block in plan_session(study, someone, number).blocks:
            for trial in block.trials:
                if trial.planned.counted:
                    for name, value in trial.planned.condition.items():
                        found.setdefault(name, (block.task, []))[1].append(value)
    return found


def _is_text(values: Sequence[Value]) -> bool:
    return any(isinstance(value, str) for value in values)


def rows(columns: Sequence[CodebookColumn]) -> list[dict[str, str]]:
    """Return the codebook ready for JSON."""
    return [asdict(column) for column in columns]


def as_csv(codebook_rows: Sequence[Mapping[str, str]]) -> str:
    """Return the codebook as comma-separated values."""
    out = io.StringIO()
    writer = csv.DictWriter(
        out, ["table", "name", "unit", "source", "definition"], lineterminator="\n"
    )
    writer.writeheader()
    writer.writerows(codebook_rows)
    return out.getvalue()
