"""Traceback of a plugin: where in its source an error arose."""

from collections.abc import Iterator
from pathlib import Path
from traceback import walk_tb

CORE = Path(__file__).parents[1]


def place(error: BaseException, module: Path | None = None) -> str:
    """Return file and line of the innermost step within the plugin: ``/study/arrow.py:12``.

    A plugin often fails in a library; its author needs the line that called it.

    Parameters
    ----------
    module
        A source file of the plugin; by default the first that was entered on the way.

    Returns
    -------
    str
        Empty when nothing outside labcrane was entered: a module that is not there.
    """
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}:{error.lineno}"
    steps = list(_steps(error))
    if not steps:
        return ""
    home = _home(module or steps[0][0])
    within = [step for step in steps if step[0].is_relative_to(home)]
    path, line = (within or steps)[-1]
    return f"{path}:{line}"


def told(error: BaseException, module: Path | None = None) -> str:
    """Return the type of an error, its message, and its origin."""
    said = f"{type(error).__name__}: {error}".removesuffix(": ")
    where = place(error, module)
    return f"{said} ({where})" if where and not isinstance(error, SyntaxError) else said


def _steps(error: BaseException) -> Iterator[tuple[Path, int]]:
    for frame, line in walk_tb(error.__traceback__):
        path = Path(frame.f_code.co_filename)
        if path.suffix == ".py" and "importlib" not in path.parts and not path.is_relative_to(CORE):
            yield path, line


def _home(module: Path) -> Path:
    """Return the files of the plugin: a package's folder, or the file alone."""
    return module.parent if (module.parent / "__init__.py").exists() else module
