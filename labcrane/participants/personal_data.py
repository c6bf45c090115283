"""Personal data: what could lead to a person, in a text and in files that are given away."""

import csv
import io
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_DOMAIN_END = re.compile(r"\.\w\w")
# Not telephone numbers, though they have many digits.
_HARMLESS = re.compile(
    r"\b\d{4}-\d\d-\d\d\b|\b\d{1,2}:\d\d(:\d\d)?\b|(?<![\d.])[-+]?\d+\.\d+(?![\d.])"
    r"|\b(ISO|IEC|DIN|EN|SAE)( J|[ /](TR|TS|EN|ISO|IEC))*[ -]?\d{3,5}(-\d{1,4})?(:(19|20)\d\d)?\b"
)
_DIGITS = re.compile(r"\+?\(?\d(?:[ ()/.\-]{0,2}\d)+")
PHONE_DIGITS = 7
"""Fewer digits than this are not a telephone number that identifies a person."""


def personal(text: str) -> str | None:
    """Return the part of ``text`` that could identify a person, in words; None without one.

    E-mail addresses and telephone numbers are found, names are not: a program cannot tell. The
    loop asks, so the time it takes grows as the text does, and no faster.
    """
    if "@" in text and any(map(_is_mail, text.split())):
        return "an e-mail address"
    for found in _DIGITS.findall(_HARMLESS.sub("|", text)):
        if sum(sign.isdigit() for sign in found) >= PHONE_DIGITS:
            return "a telephone number"
    return None


def _is_mail(word: str) -> bool:
    """Whether there is text before an @ and after it, and then a dot and two letters.

    The first @ leaves the most behind it: no other needs to be tried.
    """
    at = word.find("@", 1)
    return at > 0 and _DOMAIN_END.search(word, at + 2) is not None


_MOMENT = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d(:\d\d(\.\d+)?)?(Z|[+-]\d\d:\d\d)?")
_DIGEST = re.compile(r"\b[0-9a-f]{16,}\b")
_HOME = re.compile(r"(?:/home/|/Users/|\b[A-Z]:[\\/]+Users[\\/]+)([^/\\\s\"']+)")
_HOST = re.compile(r"<hostname>[\s-]*([^<\s-][^<\s]*)\s*</hostname>")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?|nan|inf|", re.I)
_TABLES = {".csv": ",", ".tsv": "\t"}
_HDF5 = (".h5", ".hdf5")


def personal_in(path: Path) -> Iterator[str]:
    """Yield parts of a file that could identify a person, in words with their places.

    E-mail addresses and telephone numbers in what people wrote, folders of a person's account and
    names of computers. Tables, JSON and HDF5 are read cell by cell, so that numbers and digests are
    no telephone numbers; other files are read as text. Names are not found: a program cannot tell.
    """
    for place, text in _texts(path):
        if _NUMBER.fullmatch(text.strip()):
            continue
        found = personal(_DIGEST.sub("|", _MOMENT.sub("|", text)))
        # Numbers in a program's own texts are not telephone numbers.
        if found and ("mail" in found or _is_written(place)):
            yield f"{place}: {found}"
        if home := _HOME.search(text):
            yield f"{place}: a folder of the account {home[1]!r}"
        if host := _HOST.search(text):
            yield f"{place}: the computer {host[1]!r}"


_OWN = ("context", "protocol", "header", "machine", "sync_report", "README", "CITATION")
"""Texts of a participant file that neither participants nor experimenters write."""


_NUMBERS = (" owed", " repeats", " void")
"""Ends of places of events at which a program says which trials: 5-6 8-9 11-12."""


def _is_written(place: str) -> bool:
    name = place.rsplit("/", maxsplit=1)[-1]
    return not place.endswith(_NUMBERS) and not any(own in name for own in _OWN)


def _texts(path: Path) -> Iterator[tuple[str, str]]:
    """Yield every text in a file, and where it is."""
    if path.suffix in _HDF5:
        yield from _hdf5_texts(path)
        return
    text = path.read_text(encoding="utf-8", errors="replace")
    if path.suffix in _TABLES:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=_TABLES[path.suffix])
        for number, row in enumerate(reader, start=1):
            for cell in row:
                yield from _leaves(f"line {number}", cell)
    elif path.suffix == ".json":
        yield from _leaves("", text)
    else:
        for number, line in enumerate(text.splitlines(), start=1):
            yield f"line {number}", line


def _leaves(place: str, text: str) -> Iterator[tuple[str, str]]:
    """Yield a text, or the texts in it where it is JSON."""
    if text[:1] not in {"{", "["}:
        yield place, text
        return
    try:
        content = json.loads(text)
    except ValueError:
        yield place, text
    else:
        yield from _walk(place, content)


def _walk(place: str, content: Any) -> Iterator[tuple[str, str]]:
    if isinstance(content, dict):
        for key, value in content.items():
            yield from _walk(f"{place} {key}".strip(), value)
    elif isinstance(content, list):
        for value in content:
            yield from _walk(place, value)
    elif isinstance(content, str):
        yield place, content


def _hdf5_texts(path: Path) -> Iterator[tuple[str, str]]:
    import h5py  # noqa: PLC0415 - loads for a second
    import numpy as np  # noqa: PLC0415

    found: list[tuple[str, str]] = []

    def look(name: str, node: Any) -> None:
        found.extend((f"{name}/header" if key == "machine" else name, value)
                     for key, value in node.attrs.items() if isinstance(value, str))  # fmt: skip
        if isinstance(node, h5py.Dataset) and node.dtype.kind in "OS":
            for value in np.atleast_1d(node.asstr("utf-8")[()]).ravel().tolist():
                found.extend(_leaves(name, str(value)))

    with h5py.File(path, "r") as file:
        file.visititems(look)
    yield from found
