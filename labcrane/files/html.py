"""HTML pages from templates: whatever is put into one is escaped."""

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import jinja2


def rendered(template: Path, **values: object) -> str:
    """Return a page: a template with values put into it.

    Parameters
    ----------
    template
        A file of jinja2; the files that it includes are in the same folder.
    values
        What it names; texts are escaped unless they are ``markupsafe.Markup``.

    Raises
    ------
    jinja2.UndefinedError
        The template names what it was not given.
    """
    return _environment(template.parent).get_template(template.name).render(**values)


@cache
def _environment(folder: Path) -> "jinja2.Environment":
    import jinja2  # noqa: PLC0415 - loads when a page is made

    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder, encoding="utf-8"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
