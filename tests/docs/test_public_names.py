"""Every public name has a numpydoc docstring that says units and shapes.

What numpydoc checks holds but for NOT_ASKED. Beside that: every parameter or result that is a
number has a unit, every array its shape, every field of a record a description.
"""

import ast
import inspect
import re
import typing
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from itertools import pairwise

import pytest
from numpydoc.docscrape import NumpyDocString
from numpydoc.validate import validate
from pydantic import BaseModel

import labcrane
import labcrane.testing
from labcrane.files.model import descriptions

NOT_ASKED = {
    "ES01": "a summary that says all needs no more",
    "EX01": "examples are the tutorials, which are run",
    "SA01": "the role's page says what belongs together",
    "PR01": "parameters are described where the signature does not say what they are",
    "PR04": "types are in the signature",
    "RT01": "a summary that begins with Return says what is returned",
    "YD01": "a summary that begins with Yield says what is yielded",
}
"""numpydoc's checks that are not asked for, and why."""

UNIT = re.compile(
    r"\b(m|s|rad|Hz|kg|N|Nm|bits?|seconds?|metres?|radians?|degrees?|hertz|ppm|kilograms?|newtons?|"
    r"per second|m/s|rad/s|m/rad|samples per second|ticks per second|share|fraction|scores?|"
    r"answers?|answered|the signals' units)\b|\[-1, 1\]|0 to 1|``1``",
    re.IGNORECASE,
)
"""Words that say in what a number is; shares, answers and scores have no unit and say so."""

SHAPE = re.compile(r"``\([\w+, ()]*\)``")

MODULES = (
    labcrane,
    labcrane.analysis,
    labcrane.core,
    labcrane.machines,
    labcrane.recording,
    labcrane.registry,
    labcrane.replay,
    labcrane.streams,
    labcrane.testing,
)


def public() -> Iterator[tuple[str, object]]:
    """Yield every public class and function, and their public methods, by dotted name."""
    for module in MODULES:
        for name in module.__all__:
            what = getattr(module, name)
            if inspect.isclass(what):
                yield f"{module.__name__}.{name}", what
                for part, value in vars(what).items():
                    callable_ = inspect.isfunction(value) or isinstance(value, property)
                    if not part.startswith(("_", "test_")) and callable_:
                        yield f"{module.__name__}.{name}.{part}", value
            elif inspect.isfunction(what):
                yield f"{module.__name__}.{name}", what


PUBLIC = dict(public())
FUNCTIONS = {name: what for name, what in PUBLIC.items() if inspect.isfunction(what)}
CLASSES = {name: what for name, what in PUBLIC.items() if inspect.isclass(what)}


def described(name: str) -> str:
    """Return the docstring of a name; a method of a role's child has its parent's."""
    return inspect.getdoc(PUBLIC[name]) or ""


@pytest.mark.parametrize("name", PUBLIC)
def test_docstring_is_a_numpydoc_one(name: str) -> None:
    if PUBLIC[name].__doc__ is None and inspect.getdoc(PUBLIC[name]):
        return  # inherited
    if isinstance(PUBLIC[name], property) and not name.startswith("labcrane."):
        return
    wrong = [
        f"{code}: {message}" for code, message in validate(name)["errors"] if code not in NOT_ASKED
    ]
    assert not wrong, f"{name}: {wrong}"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_arrays_have_shapes_and_numbers_have_units(name: str) -> None:
    hints = hints_of(FUNCTIONS[name])
    arrays = [part for part, hint in hints.items() if hint == labcrane.FloatArray]
    numbers = [part for part, hint in hints.items() if has_float(hint)]
    text = described(name)
    owner = name.rpartition(".")[0]
    if arrays:
        # What a role's arrays hold is said once, at the role.
        around = text + (described(owner) if owner in CLASSES else "")
        assert SHAPE.search(around), f"{name} has arrays ({', '.join(arrays)}) without a shape"
    if numbers:
        assert UNIT.search(text), f"{name} has numbers ({', '.join(numbers)}) without a unit"


def hints_of(what: object) -> dict[str, object]:
    """Return the types of a function's parameters and result, or of a record's fields."""
    import mne  # as labcrane has them for type checkers only
    import numpy.typing
    import pandas
    import pyarrow
    import pylsl

    public = {name: getattr(module, name) for module in MODULES for name in module.__all__}
    others = {"pd": pandas, "np": numpy, "npt": numpy.typing, "pa": pyarrow, "mne": mne}
    others["pylsl"] = pylsl
    return typing.get_type_hints(what, localns={**others, **public})


def has_float(hint: object) -> bool:
    """Whether a hint is a number that may have a unit."""
    return hint is float or float in typing.get_args(hint)


@pytest.mark.parametrize("name", [name for name in CLASSES if is_dataclass(CLASSES[name])])
def test_every_field_of_a_record_is_described(name: str) -> None:
    what = CLASSES[name]
    document = NumpyDocString(inspect.getdoc(what) or "")
    listed = {
        each.strip(): " ".join(entry.desc)
        for section in ("Attributes", "Parameters")
        for entry in document[section]
        for each in entry.name.split(",")
    }
    summary = " ".join([*document["Summary"], *document["Extended Summary"]])
    below = field_docstrings(what)
    hints = hints_of(what)
    for each in fields(what):
        if each.name.startswith("_"):
            continue
        text = listed.get(each.name) or below.get(each.name)
        if text is None and re.search(rf"\b{each.name}s?\b", summary):
            text = summary
        assert text is not None, f"{name}.{each.name} is not described"
        if hints[each.name] is float:
            assert UNIT.search(text + summary), f"{name}.{each.name} has no unit: {text}"


def field_docstrings(what: type) -> dict[str, str]:
    """Return the texts below the fields of a class."""
    tree = ast.parse(inspect.cleandoc("\n" + inspect.getsource(what)))
    (node,) = tree.body
    assert isinstance(node, ast.ClassDef)
    return dict(texts_below(node.body))


def texts_below(body: list[ast.stmt]) -> Iterator[tuple[str, str]]:
    """Yield each assigned name with the text that stands below it."""
    for statement, after in pairwise(body):
        target = getattr(statement, "target", None) or getattr(statement, "targets", [None])[0]
        if (
            isinstance(target, ast.Name)
            and isinstance(after, ast.Expr)
            and isinstance(after.value, ast.Constant)
            and isinstance(after.value.value, str)
        ):
            yield target.id, after.value.value


@pytest.mark.parametrize("name", [n for n, c in CLASSES.items() if issubclass(c, BaseModel)])
def test_every_key_of_a_model_is_described(name: str) -> None:
    written = descriptions(CLASSES[name])
    for key, field in CLASSES[name].model_fields.items():
        assert key in written, f"{name}.{key} is not described"
        if field.annotation is float:
            assert UNIT.search(written[key]), f"{name}.{key} has no unit: {written[key]}"
