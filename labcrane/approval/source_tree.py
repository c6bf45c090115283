"""The files of an installed package, byte by byte."""

from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path

from labcrane.errors import PluginError
from labcrane.files.atomic import sha256

CACHES = frozenset({"__pycache__", ".mypy_cache", ".ruff_cache", ".pytest_cache"})
COMPILED = frozenset({".pyc", ".pyo"})


def hashes(package: str) -> dict[str, str]:
    """Return the SHA-256 of every file of an installed package or module, caches left out.

    Names are relative to where the package is installed, with ``/`` on every system.

    Raises
    ------
    PluginError
        The package is not to be found as files.
    """
    spec = find_spec(package)
    roots = _roots(spec)
    if not roots:
        raise PluginError(
            f"package {package!r} has no files that could be hashed; install it as files"
        )
    return {
        path.relative_to(root.parent).as_posix(): sha256(path)
        for root in roots
        for path in (sorted(root.rglob("*")) if root.is_dir() else [root])
        if path.is_file() and not _is_cache(path.relative_to(root.parent))
    }


def _roots(spec: ModuleSpec | None) -> list[Path]:
    if spec is None:
        return []
    if spec.submodule_search_locations:
        return [Path(location) for location in spec.submodule_search_locations]
    return [Path(spec.origin)] if spec.origin and Path(spec.origin).is_file() else []


def _is_cache(path: Path) -> bool:
    return path.suffix in COMPILED or bool(CACHES & set(path.parts))
