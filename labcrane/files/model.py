"""Models of YAML: strict, with a schema that says what the docstring under a key says."""

import ast
import inspect
from textwrap import dedent

from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema


class StrictModel(BaseModel):
    """A part of a file: unknown keys are errors, values never change.

    The docstring under a key describes it in the JSON Schema. It is read from the source when a
    schema is asked for: reading it for every model that is imported takes as long as checking a
    protocol does.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Describe every key that does not describe itself."""
        written = handler(core)
        keys = handler.resolve_ref_schema(written).get("properties", {})
        for key, words in descriptions(cls).items():
            if key in keys:
                keys[key].setdefault("description", words)
        return written


def was_run(info: ValidationInfo) -> bool:
    """Return whether what is validated is the record of a session that was run.

    A validator that only judges, and changes nothing, asks this first and lets a record pass: it
    was accepted by the rules of its day, and by rules that came later it would be lost to replay
    and to whoever goes on with the session.

    Examples
    --------
    >>> class Lamp(Settings):
    ...     colours: tuple[str, ...]
    ...
    ...     @field_validator("colours")
    ...     @classmethod
    ...     def _differ(cls, colours: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    ...         if not was_run(info) and len(set(colours)) < len(colours):
    ...             raise ValueError("a colour is there twice")
    ...         return colours
    """
    return bool(info.context and info.context.get("recorded"))


def descriptions(model: type[BaseModel]) -> dict[str, str]:
    """Return the docstrings under a model's keys, inherited ones included, by key."""
    found: dict[str, str] = {}
    for each in reversed(model.__mro__):
        if issubclass(each, StrictModel) and each is not StrictModel:
            found |= _own(each)
    return found


def _own(model: type[BaseModel]) -> dict[str, str]:
    try:
        source = inspect.getsource(model)
    except (OSError, TypeError):  # typed at a prompt: there is no source, and so there are no words
        return {}
    (parsed,) = ast.parse(dedent(source)).body
    assert isinstance(parsed, ast.ClassDef)  # noqa: S101 - the source of a class
    return {
        key.target.id: inspect.cleandoc(words.value.value)
        for key, words in zip(parsed.body, parsed.body[1:], strict=False)
        if isinstance(key, ast.AnnAssign)
        and isinstance(key.target, ast.Name)
        and isinstance(words, ast.Expr)
        and isinstance(words.value, ast.Constant)
        and isinstance(words.value.value, str)
    }
