"""Programs of the gate, which have no ``.py`` in their names, as modules."""

from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType


def gate_program(name: str) -> ModuleType:
    """Return a program in ``.ci`` as a module."""
    loader = SourceFileLoader(name, str(Path(__file__).parents[2] / ".ci" / name))
    spec = spec_from_loader(name, loader)
    assert spec
    module = module_from_spec(spec)
    loader.exec_module(module)
    return module
