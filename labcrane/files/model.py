"""Models of YAML: strict, with a schema that says what the docstring under a key says."""

from pydantic import BaseModel, ConfigDict


class StrictModel(BaseModel):
    """A part of a file: unknown keys are errors, values never change.

    The docstring under a key describes it in the JSON Schema.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )
