"""Description of a participant file in the file itself: README, JSON-LD and citation.

A reader who gets one participant file years later, without labcrane, learns from it what it is and
how to open it.
"""

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from labcrane.recording.participant_file.columns import write_text

if TYPE_CHECKING:
    import h5py

README, DESCRIPTION, CITATION = "README", "dataset_description", "CITATION"
ABOUT = (README, DESCRIPTION, CITATION)
"""Texts next to the sessions; written again whenever the file is."""

CITE = """\
cff-version: 1.2.0
message: If you use data recorded by labcrane, please cite the software.
title: labcrane
type: software
abstract: Studies of people operating cranes, from a protocol to one file per participant
authors:
  - name: The authors of labcrane
license: Apache-2.0
"""

TEXT = """\
{title}

What one participant of the study {study!r} did: every tick of a simulated machine, of the
operator's controls and of the streams of other devices, on one clock. No name of a person is in it.

Each group ses-01, ses-02 ... is a session:
  time             seconds, one for each tick; what follows is as long as it
  loop             of each tick: its trial, its phase as a number, pauses; attributes define them
  input, command, state, task   one column per number, with its unit as an attribute
  trials           one row per trial: condition and results. trial counts all trials of the plan;
                   screens count only those with results, so that trial 8 there may be 10 here
  events           what happened when; data is JSON
  questionnaires   what was answered
  streams          signals of other devices: time is on the session's clock, time_raw is not
  context          all that was known at the start, as JSON: versions, settings, units
  sync_report      accuracy of the times
dataset_description is JSON-LD of schema.org; CITATION says how to cite the software.
Documentation: the folder docs of labcrane{version}: file-format.md, results.md.

Python  h5py.File(path)["ses-01/state/joint/angle/slew"][:], or labcrane.open_recording(path)
R       rhdf5::h5read(path, "ses-01/trials")
MATLAB  h5read(path, "/ses-01/time")
"""


def citation(version: str = "") -> str:
    """Return how labcrane is cited, in the version that was used, as a citation file has it."""
    return CITE + (f"version: {version}\n" if version else "")


def write_about(file: "h5py.File", context: Mapping[str, Any]) -> None:
    """Write the description of a participant file into it, once it contains its sessions."""
    title, study = str(context.get("title", "")), str(context.get("study", ""))
    version = str(context.get("versions", {}).get("labcrane", ""))
    of_version = f" {version}" if version else ""
    text = TEXT.format(title=title or study, study=study, version=of_version)
    write_text(file, README, text)
    description = {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "name": title or study,
        "description": f"one participant of the study {study!r}, recorded by labcrane {version}",
        "variableMeasured": _variables(file),
    }
    write_text(file, DESCRIPTION, json.dumps(description, indent=2, ensure_ascii=False))
    write_text(file, CITATION, citation(version))


def _variables(file: "h5py.File") -> list[dict[str, str]]:
    """Return the columns of all tables of trials, with their units."""
    found: dict[str, dict[str, str]] = {}
    for session in file.values():
        for name, column in getattr(session, "get", lambda *_: {})("trials", {}).items():
            unit = str(column.attrs.get("unit", ""))
            variable = {"@type": "PropertyValue", "name": str(column.attrs.get("name", name))}
            found.setdefault(name, variable | ({"unitText": unit} if unit not in {"", "1"} else {}))
    return list(found.values())
