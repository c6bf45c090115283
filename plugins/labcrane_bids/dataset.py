"""Dataset description of a BIDS export."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from labcrane import ProtocolError
from labcrane.core import HED_VERSION, read_csv_text
from labcrane_bids.files import MISSING, label, write_json, write_tsv
from labcrane_bids.phenotype import age_code
from labcrane_bids.settings import BidsSettings

BIDS_VERSION = "1.11.1"


def describe_dataset(
    folder: Path,
    settings: BidsSettings,
    contexts: Sequence[Mapping[str, Any]],
    left_out: Mapping[tuple[str, str], int],
) -> None:
    """Write ``dataset_description.json`` and the README.

    Parameters
    ----------
    left_out
        In how many sessions a stream has no place in BIDS, by its name and the reason.
    """
    title = str(contexts[0].get("title", "")) if contexts else ""
    versions = {str(context.get("versions", {}).get("labcrane", "")) for context in contexts}
    description: dict[str, Any] = {
        "Name": title or "labcrane",
        "BIDSVersion": BIDS_VERSION,
        "HEDVersion": HED_VERSION,
        "DatasetType": "raw",
        "GeneratedBy": [
            {"Name": "labcrane", "Version": ", ".join(sorted(versions - {""})) or MISSING}
        ],
    }
    approvals = [*settings.ethics, *_approvals(contexts)]
    if approvals:
        description["EthicsApprovals"] = list(dict.fromkeys(approvals))
    if settings.authors:
        description["Authors"] = list(settings.authors)
    if settings.license:
        description["License"] = settings.license
    write_json(folder / "dataset_description.json", description)
    dates = "moved to 1925 for each participant" if settings.shift_dates else "as recorded"
    names = ", ".join(
        f"{name} ({why}; sessions: {count})" for (name, why), count in sorted(left_out.items())
    )
    without = (
        f" Not included, because BIDS has no place for them: {names}; they are in the participant "
        "files and in labcrane's XDF export."
        if left_out
        else ""
    )
    (folder / "README").write_text(
        f"{title}\n\nWritten by labcrane. Motion holds the simulated machine (tracksys-crane) and "
        "the operator's sticks; times are seconds from the first tick of the session, which is the "
        f"acq_time of the scans file. Dates are {dates}. Participants of the status simulated are "
        "not people. Events have the same names everywhere (trial_type), with HED tags in their "
        f"description; in eeg they are at the sample taken at the same time.{without}\n",
        encoding="utf-8",
    )


def _approvals(contexts: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the approvals that the sessions were recorded under."""
    return [
        f"{context['approval_board']}, {context['approval']}"
        for context in contexts
        if "approval_board" in context
    ]


def describe_participants(folder: Path, rows: Sequence[Mapping[str, object]]) -> None:
    """Write ``participants.tsv`` and what its columns are."""
    import pandas as pd

    write_tsv(folder / "participants.tsv", pd.DataFrame(rows))
    write_json(
        folder / "participants.json",
        {
            "age": {
                "Description": "age of the participant as first reported; 89+ for 89 and above",
                "Units": "year",
            },
            "sex": {
                "Description": "sex as reported",
                "Levels": {"F": "female", "M": "male", "O": "other"},
            },
            "handedness": {
                "Description": "handedness as reported",
                "Levels": {"L": "left", "R": "right", "A": "ambidextrous"},
            },
            "group": {"Description": "group of the design"},
            "status": {
                "Description": "what the data are",
                "Levels": {
                    "complete": "all sessions recorded to their end",
                    "half-finished": "a session ended early or was not recorded",
                    "pilot": "a trial run",
                    "simulated": "a program took the controls",
                },
            },
        },
    )


def people_table(path: Path | None) -> dict[str, dict[str, str]]:
    """Read what is known of the people, by pseudonym."""
    if path is None:
        return {}
    if not path.is_file():
        raise ProtocolError(
            f"there is no file {path} with age, sex, handedness and group; name one with --set "
            "people=FILE, or leave it out"
        )
    try:
        return _people(csv.DictReader(io.StringIO(read_csv_text(path), newline="")), path)
    except (OSError, ValueError, csv.Error) as error:
        raise ProtocolError(f"{path} cannot be read as CSV: {error}") from error


def _people(reader: "csv.DictReader[str]", path: Path) -> dict[str, dict[str, str]]:
    if "participant" not in (reader.fieldnames or ()):
        there = ", ".join(reader.fieldnames or ()) or "none"
        raise ProtocolError(
            f"{path} has no column 'participant'; its columns are {there}: add one with the "
            "pseudonyms"
        )
    people: dict[str, dict[str, str]] = {}
    for row in reader:
        if None in row or None in row.values():
            raise ProtocolError(
                f"{path}, line {reader.line_num}: this row has more or fewer cells than the head "
                "has columns; give it as many"
            )
        if (name := row["participant"]) in people:
            raise ProtocolError(
                f"{path}, line {reader.line_num}: {name!r} is listed twice; keep one row"
            )
        people[name] = {name: cell for name, cell in row.items() if cell}
        if "age" in people[name]:
            people[name]["age"] = _age(people[name]["age"])
    return people


def _age(cell: str) -> str:
    """Return an age as BIDS writes it; words stay as they are."""
    try:
        return age_code(float(cell))
    except ValueError:
        return cell


def copy_phenotype(source: Path | None, folder: Path, recorded: Sequence[str] = ()) -> None:
    """Write each questionnaire of a folder as ``phenotype/NAME.tsv`` with its description.

    Parameters
    ----------
    recorded
        What the recordings have filled already.
    """
    if source is None:
        return
    import pandas as pd

    tables = sorted(source.glob("*.csv"))
    if not tables:
        raise ProtocolError(
            f"there is no CSV file in {source}; put one there for each questionnaire, or leave "
            "phenotype out"
        )
    (folder / "phenotype").mkdir(exist_ok=True)
    for path in tables:
        if path.stem in recorded:
            raise ProtocolError(
                f"questionnaire {path.stem!r} is in the recordings and in {path}; give the file "
                "another name, or leave it out"
            )
        described = path.with_suffix(".json")
        if not described.is_file():
            raise ProtocolError(f"{path} has no description; write {described} beside it")
        try:
            table = pd.read_csv(io.StringIO(read_csv_text(path)))
        except (OSError, ValueError) as error:
            raise ProtocolError(f"{path} cannot be read as CSV: {error}") from error
        if "participant" not in table:
            raise ProtocolError(
                f"{path} has no column 'participant'; its columns are "
                f"{', '.join(map(str, table))}: add one with the pseudonyms"
            )
        names = [f"sub-{label(str(name))}" for name in table.pop("participant")]
        table.insert(0, "participant_id", names)
        write_tsv(folder / "phenotype" / f"{path.stem}.tsv", table)
        content = _description(described)
        write_json(folder / "phenotype" / f"{path.stem}.json", content)


def _description(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ProtocolError(f"{path} is not valid JSON: {error}; correct the file") from error
    if not isinstance(content, dict):
        raise ProtocolError(
            f"{path} holds {type(content).__name__}; it must hold an object with a key for each "
            "column"
        )
    return content
