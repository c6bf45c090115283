"""Library of machines: those that come with labcrane, and YAML files of a study."""

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from labcrane.errors import ProtocolError, nearest
from labcrane.files.system import is_file
from labcrane.files.yaml import YamlFile
from labcrane.machines.machine import Machine


def machine_names() -> list[str]:
    """Return the names of the machines that come with labcrane."""
    folder = files("labcrane") / "machines" / "data"
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def find_machine(name: str, beside: Path | None = None) -> Path:
    """Return the file of machine ``name``; ``beside`` is the study's folder."""
    if name.endswith((".yaml", ".yml")):
        path = (beside or Path()) / name
        if is_file(path):
            return path
        raise ProtocolError(
            f"machine file {str(path)!r} does not exist; paths are relative to the protocol's "
            "folder"
        )
    if name.endswith(".urdf"):
        raise ProtocolError(
            f"machine is {name!r}, a robot's file; write machine: {{urdf: {name}, joints: ..., "
            "tip: ...}, with the study's names for its joints"
        )
    if name in machine_names():
        return Path(str(files("labcrane") / "machines" / "data" / f"{name}.yaml"))
    there = nearest(name, machine_names(), "labcrane has")
    raise ProtocolError(
        f"no machine is called {name!r}; {there}, or name a .yaml file in the protocol's folder"
    )


def load_machine(name: str | Mapping[str, Any], beside: Path | None = None) -> Machine:
    """Return a machine as a protocol names it.

    Raises
    ------
    ProtocolError
        The machine does not exist, or its file is wrong; the message names file and line.
    """
    return read_machine(name, beside)[0]


def read_machine(
    name: str | Mapping[str, Any], beside: Path | None = None, *, recorded: bool = False
) -> tuple[Machine, str]:
    """Return a machine as a protocol names it, and the text of its YAML.

    Parameters
    ----------
    name
        One that comes with labcrane, a YAML file, or what describes one in another format
        (:class:`labcrane.machines.descriptions.description.MachineDescription`).

    Raises
    ------
    ProtocolError
        The machine does not exist, or its file is wrong; the message names file and line.
    """
    if isinstance(name, str):
        path = find_machine(name, beside)
        machine = YamlFile.read(path, recorded=recorded).checked(Machine)
        return machine, path.read_text(encoding="utf-8")
    from labcrane.machines.descriptions.description import MachineDescription  # noqa: PLC0415

    return MachineDescription.model_validate(name).read(beside or Path())
