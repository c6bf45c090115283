"""Archive for a repository: Psych-DS tables, recordings, codebook, licence, checksums."""

import hashlib
import json
import re
import shutil
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from labcrane import ProtocolError
from labcrane.analysis import Exporter, Participant, codebook_of, measures_of
from labcrane.participants import personal_in
from labcrane_tables.psychds import PsychDs
from labcrane_tables.settings import ArchiveSettings, PsychDsSettings
from labcrane_tables.tables import write_csv

CHECKSUMS = "manifest-sha256.txt"
MOST = 10
"""Number of findings in one message."""

HOST = re.compile(rb"(<hostname>)([^<]*)(</hostname>)")

README = """\
# {title}

{description}

| | |
|---|---|
| `data/` | one CSV file per participant and session: trials, answers, scores (Psych-DS) |
{recordings}| `codebook.csv` | unit, meaning and source of every column |
| `dataset_description.json` | the same for machines (JSON-LD of schema.org, Psych-DS) |
| `LICENSE`, `CITATION.cff` | terms of use, and how to cite the software |
| `{checksums}` | SHA-256 of every file: `sha256sum -c {checksums}` |

Licence: {license}. Participants have pseudonyms; this archive does not contain their names.
"""
RECORDINGS = "| `recordings/` | one HDF5 file per participant: every tick; its README is inside |\n"


class Archive(Exporter):
    """One zip file for a repository such as OSF or Zenodo, and a file with its checksum.

    Nothing is written if the content includes personal data: e-mail addresses, telephone numbers,
    accounts and names of computers. The computer names that LSL stores with every stream are
    removed from the recordings.
    """

    def __init__(self, settings: ArchiveSettings) -> None:
        self._settings = settings

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        inside = folder / ".archive"
        inside.mkdir()
        try:
            study = self._fill(participants, inside)
            _refuse_personal(inside)
            _write_checksums(inside)
            archive = folder / f"{study}.zip"
            _pack(inside, archive)
        finally:
            shutil.rmtree(inside)
        digest = hashlib.sha256(archive.read_bytes()).hexdigest()
        beside = archive.with_name(f"{archive.name}.sha256")
        beside.write_text(f"{digest}  {archive.name}\n", encoding="utf-8")

    def _fill(self, participants: Iterable[Participant], folder: Path) -> str:
        """Put everything into a folder; return the name of the study."""
        import pandas as pd

        books: list[pd.DataFrame] = []
        context: dict[str, Any] = {}

        def noted() -> Iterator[Participant]:
            for participant in participants:
                context.update(participant.context)
                books.append(codebook_of(participant, measures_of(participant)))
                if self._settings.recordings:
                    (folder / "recordings").mkdir(exist_ok=True)
                    copy = folder / "recordings" / f"{participant.name}.h5"
                    shutil.copyfile(participant.path, copy)
                    _hide_computers(copy)
                yield participant

        about = PsychDsSettings(description=self._settings.description)
        PsychDs(about).export(noted(), folder)
        book = pd.concat(books).drop_duplicates(["table", "column"])
        write_csv(book, folder / "codebook.csv")
        self._describe(folder, context)
        return str(context.get("study", "")) or "study"

    def _describe(self, folder: Path, context: Mapping[str, Any]) -> None:
        from labcrane.recording import citation

        title = str(context.get("title", ""))
        path = folder / "dataset_description.json"
        described = json.loads(path.read_text(encoding="utf-8"))
        described["license"] = f"https://spdx.org/licenses/{self._settings.license}.html"
        if self._settings.authors:
            described["creator"] = [
                {"@type": "Person", "name": name} for name in self._settings.authors
            ]
        text = json.dumps(described, indent=2, ensure_ascii=False) + "\n"
        path.write_text(text, encoding="utf-8")
        readme = README.format(
            title=title,
            description=self._settings.description or title,
            recordings=RECORDINGS if self._settings.recordings else "",
            license=self._settings.license,
            checksums=CHECKSUMS,
        )
        (folder / "README.md").write_text(readme, encoding="utf-8")
        licence = (
            f"The data are licensed under {self._settings.license}:\n"
            f"https://spdx.org/licenses/{self._settings.license}.html\n"
        )
        (folder / "LICENSE").write_text(licence, encoding="utf-8")
        version = str(context.get("versions", {}).get("labcrane", ""))
        (folder / "CITATION.cff").write_text(citation(version), encoding="utf-8")


def _hide_computers(path: Path) -> None:
    """Remove the names of computers from LSL's stream headers: they are often people's names.

    The number of characters stays the same, so that no remains of the old text stay in the file.
    """
    import h5py
    import numpy as np

    from labcrane.recording import put_seal

    hidden: dict[str, bytes] = {}

    def look(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and name.endswith("/header"):
            text = node[()]
            without = HOST.sub(lambda found: found[1] + b"-" * len(found[2]) + found[3], text)
            if without != text:
                hidden[name] = without

    with h5py.File(path, "r") as file:
        file.visititems(look)
    if hidden:
        with h5py.File(path, "r+") as file:
            for name, text in hidden.items():
                file[name][()] = np.bytes_(text)
        put_seal(path)


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def _refuse_personal(folder: Path) -> None:
    found = [
        f"{path.relative_to(folder).as_posix()}, {what}"
        for path in _files(folder)
        for what in dict.fromkeys(personal_in(path))
    ]
    if found:
        more = f"; and {len(found) - MOST} more" if len(found) > MOST else ""
        raise ProtocolError(
            f"the archive would contain personal data: {'; '.join(found[:MOST])}{more}; "
            "leave the participant files out with --set recordings=false, or the person with "
            "labcrane exclude"
        )


def _write_checksums(folder: Path) -> None:
    lines = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(folder).as_posix()}\n"
        for path in _files(folder)
    ]
    (folder / CHECKSUMS).write_text("".join(lines), encoding="utf-8")


def _pack(folder: Path, archive: Path) -> None:
    """Pack a folder; the same files make the same archive, whenever they were written."""
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as out:
        for path in _files(folder):
            info = zipfile.ZipInfo(path.relative_to(folder).as_posix())
            info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            out.writestr(info, path.read_bytes())
