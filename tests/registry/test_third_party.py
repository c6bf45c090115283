"""A bundled plugin, copied out and installed as its README says, is found."""

import re
import shutil
import tomllib
from pathlib import Path

import pytest

from labcrane import Task
from labcrane.testing import discover

PLUGINS = Path(__file__).parents[2] / "plugins"


def test_copied_plugin_is_discovered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Copy and rename, as plugins/README.md says.
    package = tmp_path / "labcrane_pier"
    shutil.copytree(PLUGINS / "labcrane_aiming", package)
    for module in package.glob("*.py"):
        text = module.read_text(encoding="utf-8").replace("labcrane_aiming", "labcrane_pier")
        module.write_text(text.replace('"aiming"', '"pier"'), encoding="utf-8")

    # Install it: this is all that pip would leave behind.
    example = re.search(
        r"```toml\n(.+?)```", (PLUGINS / "README.md").read_text(encoding="utf-8"), re.S
    )
    assert example
    points = tomllib.loads(example[1])["project"]["entry-points"]["labcrane"]
    metadata = tmp_path / "labcrane_pier-0.1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: labcrane-pier\nVersion: 0.1.0\n", encoding="utf-8"
    )
    lines = [f"{name} = {value}" for name, value in points.items()]
    (metadata / "entry_points.txt").write_text("\n".join(["[labcrane]", *lines]), encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)

    registry = discover()
    assert {"aiming", "pier"} <= set(registry.offers[Task])
    assert registry.plugins[Task]["pier"] == "pier"
