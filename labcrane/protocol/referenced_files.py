"""Files that components' settings name, recorded with what they say: a record needs nothing else.

They are named from the protocol's folder, wherever that was.
"""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from labcrane.core.settings import Settings
from labcrane.errors import ProtocolError
from labcrane.files.system import is_file
from labcrane.files.yaml import parse_yaml

YAML = (".yaml", ".yml")

CODE = (".py", ".pyc", ".pyd", ".so", ".pth")
"""Endings of what Python imports."""


def plain_settings(settings: Settings, folder: Path) -> Any:
    """Return settings as JSON holds them, with the study's files named from its ``folder``."""
    names = {str(path): _name(path, folder) for path in paths_in(settings.model_dump())}
    return _renamed(settings.model_dump(mode="json"), names)


def named_files(every: Iterable[Settings], folder: Path) -> dict[str, dict[str, str | None]]:
    """Return the content of every file that settings name, by its path from ``folder``.

    It includes the YAML files that these name under ``use``, and the meshes under ``mesh``.
    ``text`` is None for files that are not text; ``sha256`` always exists.
    """
    found: dict[str, dict[str, str | None]] = {}
    for settings in every:
        for named in paths_in(settings.model_dump()):
            for path in (named, *used(named)):
                if not (path.is_absolute() and path.is_file()):
                    continue
                raw = path.read_bytes()
                try:
                    text = raw.decode("utf-8")
                except UnicodeDecodeError:
                    text = None
                digest = hashlib.sha256(raw).hexdigest()
                found[_name(path, folder)] = {"sha256": digest, "text": text}
    return found


def used(path: Path) -> list[Path]:
    """Return the files that a YAML file of the study uses, and those that these use.

    Their paths are relative to it: ``use: parts/car.yaml``, ``mesh: boulder.obj``.
    """
    found: dict[Path, None] = {}
    waiting = [path]
    while waiting:
        new = [each for each in _used(waiting.pop()) if each not in found]
        found.update(dict.fromkeys(new))
        waiting += new
    return list(found)


def _used(path: Path) -> list[Path]:
    if path.suffix not in YAML or not is_file(path):
        return []
    try:
        data = parse_yaml(path.read_text(encoding="utf-8", errors="replace"), str(path))
    except ProtocolError:  # no YAML after all, which its reader says
        return []
    return [path.parent / name for name in dict.fromkeys(_names(data))]


def _names(data: object) -> Iterator[str]:
    if isinstance(data, Mapping):
        if isinstance(name := data.get("use"), str) and name.endswith(YAML):
            yield name
        mesh = data.get("mesh")
        if isinstance(name := mesh.get("file") if isinstance(mesh, Mapping) else mesh, str):
            yield name
        for value in data.values():
            yield from _names(value)
    elif isinstance(data, list):
        for value in data:
            yield from _names(value)


def write_files(files: Mapping[str, Mapping[str, str | None]], folder: Path) -> None:
    """Write recorded files into ``folder``; those outside of the study's stay where they are.

    Settings name data; a file of code among them is nothing that labcrane recorded, and where it
    is put it might be taken for a plugin of the study.
    """
    for name, file in files.items():
        path, text = folder / name, file["text"]
        inside = path.resolve().is_relative_to(folder.resolve())
        if text is not None and inside and path.suffix.lower() not in CODE:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")


def _name(path: Path, folder: Path) -> str:
    inside = folder.resolve()
    whole = path.resolve() if path.is_absolute() else path
    return whole.relative_to(inside).as_posix() if whole.is_relative_to(inside) else str(path)


def paths_in(value: object) -> Iterator[Path]:
    """Yield every path in settings as plain data."""
    if isinstance(value, Path):
        yield value
    elif isinstance(value, Mapping):
        for item in value.values():
            yield from paths_in(item)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from paths_in(item)


def _renamed(value: Any, names: Mapping[str, str]) -> Any:
    if isinstance(value, str):
        return names.get(value, value)
    if isinstance(value, dict):
        return {key: _renamed(item, names) for key, item in value.items()}
    return [_renamed(item, names) for item in value] if isinstance(value, list) else value
