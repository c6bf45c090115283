"""Commands for users and authors of plugins: plugins, schema, new-plugin."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.cli.options import AsJson
from labcrane.cli.output import out, whole_table
from labcrane.errors import PluginError

if TYPE_CHECKING:
    from labcrane.registry.description import OfferSheet
    from labcrane.registry.registry import Registry

OfStudy = Annotated[
    Path | None, typer.Option("--study", help="a protocol, whose own plugins are included")
]

app = typer.Typer(invoke_without_command=True)


@app.callback()
def plugins(context: typer.Context, study: OfStudy = None, as_json: AsJson = False) -> None:
    """List installed plugins; ``show NAME`` describes one of their components."""
    if context.invoked_subcommand is not None:
        return
    from labcrane.registry.hookspecs import ROLES
    from labcrane.registry.registry import discover

    registry = discover(study=study)
    if as_json:
        typer.echo(json.dumps(_listed(registry), indent=1, ensure_ascii=False))
        return
    table = whole_table("role", "name", "plugin", "settings")
    for role, entry in ROLES.items():
        for name, offer in sorted(registry.offers[role].items()):
            settings = ", ".join(offer.settings.model_fields)
            table.add_row(entry.word, name, registry.plugins[role][name], settings)
    out.print(table)
    for plugin, why in registry.broken.items():
        out.print(f"plugin {plugin!r} is broken: {why}", markup=False, style="red")


@app.command("show")
def show(
    name: Annotated[str, typer.Argument(help="what a protocol writes after use:")],
    study: OfStudy = None,
    as_json: AsJson = False,
) -> None:
    """Show a plugin's settings, units, defaults, recorded signals and an example."""
    from labcrane.errors import suggestion
    from labcrane.machines.library import load_machine
    from labcrane.registry.description import sheets
    from labcrane.registry.registry import discover

    registry = discover(study=study)
    found = sheets(registry, name, load_machine("ch8"))
    if not found:
        known = sorted({each for offers in registry.offers.values() for each in offers})
        raise PluginError(f"nothing called {name!r} is installed; {suggestion(name, known)}")
    if as_json:
        typer.echo(json.dumps([sheet.as_json() for sheet in found], indent=1, ensure_ascii=False))
        return
    for sheet in found:
        _print(sheet)


def schema(
    study: OfStudy = None,
    file: Annotated[
        Path | None, typer.Option("--out", help="a file; the terminal by default")
    ] = None,
) -> None:
    """Write the JSON Schema of protocols, with all installed settings."""
    from labcrane.files.atomic import SHARED_FILE, write_text
    from labcrane.protocol.json_schema import protocol_schema
    from labcrane.registry.registry import discover

    text = json.dumps(protocol_schema(discover(study=study)), indent=1, ensure_ascii=False)
    if file is None:
        typer.echo(text)
    else:
        write_text(file, text + "\n", SHARED_FILE)
        out.print(f"schema: {file}", markup=False)


def new_plugin(
    role: Annotated[str, typer.Argument(help="input, controller, dynamics, task, cue, ...")],
    name: Annotated[str, typer.Argument(help="what a protocol is to write after use:")],
    into: Annotated[Path, typer.Option(help="where the folder is made")] = Path(),
) -> None:
    """Create a plugin that installs and passes its tests, as a starting point."""
    from labcrane.registry.registry import discover
    from labcrane.registry.scaffold import write_plugin

    folder = write_plugin(role, name, into, discover())
    out.print(f"plugin: {folder}", markup=False)
    said = f"next: pip install -e '{folder}[test]', and change {folder}/labcrane_{name}.py"
    out.print(said, markup=False)


def _listed(registry: "Registry") -> dict[str, object]:
    from labcrane.registry.hookspecs import ROLES

    offers = [
        {
            "role": entry.word,
            "name": name,
            "plugin": registry.plugins[role][name],
            "settings": list(offer.settings.model_fields),
        }
        for role, entry in ROLES.items()
        for name, offer in sorted(registry.offers[role].items())
    ]
    return {"offers": offers, "broken": dict(registry.broken)}


def _print(sheet: "OfferSheet") -> None:
    out.print(
        f"{sheet.role} {sheet.name!r} of plugin {sheet.plugin!r}: {sheet.about}", markup=False
    )
    if sheet.settings:
        table = whole_table("setting", "possible", "default", "meaning")
        for each in sheet.settings:
            default = "must be given" if each.default is None else each.default
            table.add_row(*map(_literal, (each.name, each.possible, default, each.meaning)))
        out.print(table)
    if sheet.recorded is None:
        out.print("what it records depends on settings without a default, or on the machine")
    elif sheet.recorded:
        table = whole_table("records", "unit", "how often", "definition")
        for column in sheet.recorded:
            row = (column.column, column.unit, column.where, column.definition)
            table.add_row(*map(_literal, row))
        out.print(table)
    out.print(f"\n{sheet.example}\n", markup=False)


def _literal(text: str) -> str:
    from rich.markup import escape

    return escape(text)
