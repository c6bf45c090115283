"""Reports without figures, for tests of tables and sentences: drawing takes half of the time."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from labcrane.analysis.report import html


@contextmanager
def without_figures() -> Iterator[None]:
    """Write empty files in place of a report's figures by Matplotlib."""

    def left_empty(_: object, path: Path, footer: str = "") -> None:
        for form in ("svg", "png", "pdf"):
            path.with_name(f"{path.name}.{form}").touch()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(html, "save", left_empty)
        yield
