"""A new plugin: a folder that installs, passes its contract tests, and can be changed."""

import keyword
import re
from collections.abc import Mapping
from pathlib import Path

from labcrane.errors import PluginError, suggestion
from labcrane.files.atomic import SHARED_FILE, write_text
from labcrane.registry.commands import plugin_commands
from labcrane.registry.registry import Registry

TEMPLATES = Path(__file__).parent / "templates"
ANY = "any"
"""The folder of what every plugin needs, beside one for each role."""

ALIASES = {"scheme": "controller", "input_device": "input", "commands": "command"}
"""What else a role is called."""

A_ROLE: Mapping[str, str] = {
    "input": "a device that the operator moves",
    "controller": "a scheme, from the operator's axes to the machine's commands",
    "dynamics": "a machine to operate",
    "task": "a task for the operator",
    "exporter": "a format for recordings",
    "questionnaire": "questions for the participant",
    "monitor": "a monitor of other programs' signals",
    "cue": "something to be seen in every view",
    "feedback": "a device that presents the session",
    "command": "a command of the command line",
}
"""What a plugin of each role is, in words."""

GROUP = """
# And this one names the group of its commands, which `labcrane --help` lists.
[project.entry-points."labcrane.commands"]
my_part = "my_module"
"""

USED: Mapping[str, tuple[str, str]] = {
    "input": (
        "operator: {use: simulated_operator}",
        "operator: {use: my_part}",
    ),
    "controller": (
        "scheme:\n  use: joint_velocity\n"
        "  map: {slew: left.x, elbow: left.y, wrist: right.x, shoulder: -right.y}\n",
        "scheme: {use: my_part}\n",
    ),
    "dynamics": ("dynamics: {use: kinematic_crane}", "dynamics: {use: my_part}"),
    "task": (
        "  work: {use: aiming, distances: [2], movements: 1, limit_s: 10}",
        "  work: {use: my_part}",
    ),
    "questionnaire": (
        "      - block: {task: work}\n",
        "      - block: {task: work}\n      - questionnaire: my_part\n",
    ),
    "monitor": ("sessions:", "monitors:\n  level: {use: my_part}\nsessions:"),
    "cue": ("sessions:", "feedback:\n  line: {use: my_part}\nsessions:"),
    "feedback": ("sessions:", "feedback:\n  lamp: {use: my_part}\nsessions:"),
}
"""What is put in place of what in the protocol, so that it uses the plugin."""


def write_plugin(role: str, name: str, into: Path, registry: Registry) -> Path:
    """Write the folder of a new plugin below ``into``; return its path.

    Raises
    ------
    PluginError
        There is no such role, the name cannot be used, or the folder exists.
    """
    role = _role(role)
    _check_name(role, name, registry)
    folder = into / f"labcrane-{name.replace('_', '-')}"
    if folder.exists():
        raise PluginError(
            f"{folder} exists already, and nothing is overwritten; give another name, or another "
            "place with --into"
        )
    folder.mkdir(parents=True)
    for template in sorted([*(TEMPLATES / ANY).iterdir(), *(TEMPLATES / role).iterdir()]):
        if template.is_file():
            text = template.read_text(encoding="utf-8")
            if template.name == "protocol.yaml":
                text = text.replace(*USED.get(role, ("", "")))
            if template.name == "pyproject.toml" and role == "command":
                text += GROUP
            path = folder / _filled(template.name, role, name)
            write_text(path, _filled(text, role, name), SHARED_FILE)
    return folder


def _role(role: str) -> str:
    known = ALIASES.get(role, role)
    if known in A_ROLE:
        return known
    raise PluginError(f"there is no role {role!r}; {suggestion(role, A_ROLE)}")


def _check_name(role: str, name: str, registry: Registry) -> None:
    if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name) or keyword.iskeyword(name):
        raise PluginError(
            f"{name!r} cannot name a plugin; give a lower-case word of letters, digits and single "
            "underscores, such as my_arrow"
        )
    if role == "command" and not name.isalpha():
        raise PluginError(f"{name!r} cannot name a command; give one word of letters")
    for offers in registry.plugins.values():
        if name in offers:
            raise PluginError(
                f"plugin {offers[name]!r} offers {name!r} already; choose another name"
            )
    if role == "command" and name in {group for group, _ in plugin_commands()}:
        raise PluginError(f"there are commands {name!r} already; choose another name")


def _filled(text: str, role: str, name: str) -> str:
    camel = "".join(word.capitalize() for word in name.split("_"))
    for placeholder, word in (
        ("my_module", f"labcrane_{name}"),
        ("my_part", name),
        ("my-project", f"labcrane-{name.replace('_', '-')}"),
        ("MyPart", camel),
        ("a_role", A_ROLE[role]),
    ):
        text = text.replace(placeholder, word)
    return text
