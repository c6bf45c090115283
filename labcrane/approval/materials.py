"""Everything that a protocol refers to, as plain data that can be compared and hashed."""

import hashlib
import os
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from labcrane.approval.source_tree import hashes
from labcrane.errors import ProtocolError
from labcrane.files.atomic import sha256
from labcrane.files.names import outside
from labcrane.files.system import is_file, is_folder, is_there
from labcrane.files.yaml import YamlFile, parse_yaml
from labcrane.protocol.referenced_files import paths_in
from labcrane.protocol.study import Study
from labcrane.registry.entry_points import EntryPoint, entry_points_of
from labcrane.registry.hookspecs import PROJECT
from labcrane.registry.registry import Registry

DATA = frozenset({".yaml", ".yml", ".json"})
NAMELESS = frozenset({".obj", ".stl", ".pdf"})
"""Files that name no other files."""

MOST_TEXT = 1_000_000
"""Bytes of a file of no known kind that may be YAML and name others."""

ROBOTS = frozenset({".urdf"})
OF_THE_LAB = frozenset({"certificate", "key"})
"""Settings of a page that belong to the laboratory and stay out of the lock: everybody may read a
lock but no one a private key, and a renewed certificate does not change the study."""
OWN = "the study's own"
"""Replaces the version of a file in the study's plugins folder."""

WORDS_ONLY = frozenset({"study", "title", "participants", "operator", "labcrane"})
"""Keys of a protocol under which no plugin for people is named."""


def materials(
    study: Study,
    registry: Registry,
    consent: Path | None = None,
) -> dict[str, Any]:
    """Return the materials of ``study``, ready for JSON.

    The protocol and YAML or JSON files count as data: white space and comments in them do not
    matter. Other texts count line by line, everything else, and all source, byte by byte. Nothing
    in it depends on the computer or on where the study lies.

    Parameters
    ----------
    consent
        The consent text, which belongs to the study without being named in the protocol.
    """
    protocol = YamlFile.read(study.path).data
    folder = study.path.parent
    said = [*study_files(protocol, folder), *files_of_settings(study)]
    named = {_inside(path, folder): path for path in said}
    found: dict[str, Any] = {
        "protocol": protocol,
        "files": {name: content(path) for name, path in sorted(named.items())},
        "machine": content_of_text(study.machine_text, data=True),
        "settings": settings(study),
        "plugins": _plugins(study, registry, protocol),
        "labcrane": {"version": version("labcrane"), "files": hashes("labcrane")},
    }
    if consent is not None and consent.is_file():
        found["consent"] = {consent.relative_to(folder).as_posix(): content(consent)}
    return found


def settings(study: Study) -> dict[str, Any]:
    """Return the settings of every component for people, defaults included.

    Raises
    ------
    ProtocolError
        A setting names a file that would not move with the study, and be no part of the lock.
    """
    folder = study.path.parent
    return {
        part: _portable(choice.settings.model_dump(), folder, part)
        for part, choice in study.choices.items()
    }


def files_of_settings(study: Study) -> list[Path]:
    """Return the files that settings name, those by default included, and what these name."""
    paths = [
        path
        for choice in study.choices.values()
        for path in paths_in(choice.settings.model_dump())
        if not outside(path, study.path.parent)
    ]
    return referred([str(path.absolute()) for path in paths], study.path.parent)


def _inside(path: Path, folder: Path) -> str:
    """Return a path relative to the study's folder, however it was named.

    A link inside the folder keeps its own name; a way to the folder through one does not count.
    """
    whole, above = (Path(os.path.abspath(each)) for each in (path, folder))  # noqa: PTH100 - links are left as they are
    if not whole.is_relative_to(above):
        whole, above = path.resolve(), folder.resolve()
    return whole.relative_to(above).as_posix()


def _portable(value: object, folder: Path, part: str) -> Any:
    """Return settings as plain data that are the same on every computer."""
    if isinstance(value, Mapping):
        return {str(key): _portable(item, folder, part) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_portable(item, folder, part) for item in value]
    if not isinstance(value, Path):
        return value if isinstance(value, bool | int | float | str | None) else str(value)
    if why := outside(value, folder):
        raise ProtocolError(f"{part} names {value}: {why}")
    return _inside(value, folder)


def study_files(protocol: Mapping[str, Any], folder: Path) -> list[Path]:
    """Return the files that a protocol names but those of :data:`OF_THE_LAB`."""
    page = protocol.get("page")
    if not isinstance(page, Mapping):
        return referred(protocol, folder)
    shown = {key: value for key, value in page.items() if key not in OF_THE_LAB}
    return referred({**protocol, "page": shown}, folder)


def referred(data: object, folder: Path) -> list[Path]:
    """Return the files that ``data`` names, and those that these name, below ``folder``.

    Every text that is the path of a file counts, from ``folder`` or from beside the file that names
    it; a folder counts with all that is in it when it is written with a slash.
    """
    found: dict[Path, None] = {}
    waiting = [(text, folder) for text in _strings(data)]
    while waiting:
        text, beside = waiting.pop()
        for path in (*_paths(text, folder, folder), *_paths(text, beside, folder)):
            if path in found:
                continue
            found[path] = None
            waiting += [
                (name, beside)
                for name in _strings(_named_in(path))
                for beside in _beside(path, folder)
            ]
    return list(found)


def _beside(path: Path, folder: Path) -> list[Path]:
    """Return the base folders of a file's references: for robots, any folder above it too."""
    if path.suffix not in ROBOTS:
        return [path.parent]
    return [above for above in path.parents if above.is_relative_to(folder)]


def _named_in(path: Path) -> Any:
    if path.suffix in DATA:
        return _parsed(path.read_text(encoding="utf-8"))
    if path.suffix in ROBOTS:
        return list(_named_by_robot(path))
    if path.suffix in NAMELESS or (text := _short_text(path)) is None:
        return None
    return _parsed(text)  # whatever it is called


def _short_text(path: Path) -> str | None:
    """Return a file's text, if it is short enough to be YAML."""
    if path.stat().st_size > MOST_TEXT:
        return None
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return None
    return None if "\0" in text else text


def _named_by_robot(path: Path) -> Iterator[str]:
    """Yield the files that a URDF file names: meshes and textures."""
    try:
        root = ElementTree.parse(path)  # noqa: S314 - expat refuses entity bombs
    except (ElementTree.ParseError, ValueError):
        return  # not a robot: its reader reports it
    for element in root.iter():
        name = element.get("filename", "").removeprefix("file://")
        if name.startswith("package://"):
            name = name.removeprefix("package://").partition("/")[2]
        if name:
            yield name


def _paths(text: str, beside: Path, folder: Path) -> list[Path]:
    if not text or "\0" in text:
        return []
    path = beside / text
    if not is_there(path) or outside(path, folder):
        return []
    if is_file(path):
        return [path]
    if is_folder(path) and "/" in text:
        return [file for file in sorted(path.rglob("*")) if file.is_file()]
    return []


def _strings(data: object) -> Iterator[str]:
    if isinstance(data, str):
        yield data
    elif isinstance(data, Mapping):
        for key, value in data.items():
            yield str(key)
            yield from _strings(value)
    elif isinstance(data, list):
        for value in data:
            yield from _strings(value)


def content(path: Path) -> dict[str, Any]:
    """Return a file's content in a form that can be compared in words."""
    raw = path.read_bytes()
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError:
        text = ""
    if not text or "\0" in text or path.suffix == ".pdf":
        return {"sha256": hashlib.sha256(raw).hexdigest()}
    return content_of_text(text, data=path.suffix in DATA)


def content_of_text(text: str, *, data: bool) -> dict[str, Any]:
    """Return a text as data when it is YAML or JSON, else as lines, whatever ends them."""
    if data and (parsed := _parsed(text)) is not None:
        return {"data": parsed}
    return {"lines": [line.rstrip("\r") for line in text.removesuffix("\n").split("\n")]}


def _parsed(text: str) -> Any:
    """Return YAML, of which JSON is a part, as plain data; None if it is not YAML."""
    try:
        return _json_like(parse_yaml(text, "a file of the study"))
    except ProtocolError:
        return None


def _json_like(value: object) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _json_like(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_json_like(item) for item in value]
    return value if isinstance(value, bool | int | float | str | None) else str(value)


def _plugins(study: Study, registry: Registry, protocol: Mapping[str, Any]) -> dict[str, Any]:
    """Return version and source of every plugin that offers something the protocol names."""
    choices = (study.input, study.scheme, study.dynamics, *study.task_choices.values())
    used = {choice.plugin for choice in choices}
    said = set(_strings({key: value for key, value in protocol.items() if key not in WORDS_ONLY}))
    for offers in registry.plugins.values():
        used |= {plugin for name, plugin in offers.items() if name in said}
    points = {point.name: point for point in entry_points_of(PROJECT)}
    found = {name: _plugin(points[name]) for name in sorted(used - registry.local.keys())}
    # Every file in the study's own folder runs when the study is read, whatever it offers.
    own = {
        name: {"version": OWN, "files": {name: sha256(path)}}
        for name, path in registry.local.items()
    }
    return found | own


def _plugin(point: EntryPoint) -> dict[str, Any]:
    return {
        "version": point.dist.version if point.dist else "unknown",
        "files": hashes(point.module.split(".")[0]),
    }
