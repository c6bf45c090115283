"""Models of YAML: strict, with a schema that says what the docstring under a key says."""

from pydantic import BaseModel, ConfigDict, ValidationInfo


class StrictModel(BaseModel):
    """A part of a file: unknown keys are errors, values never change.

    The docstring under a key describes it in the JSON Schema.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


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
