"""Settings of components: the model of what a protocol writes beside ``use``."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, ValidationInfo

from labcrane.files.model import StrictModel
from labcrane.files.yaml import read_yaml as read_yaml  # noqa: PLC0414 - public here


class Settings(StrictModel):
    """Base of every plugin's settings: unknown keys are errors, values never change."""

    def warnings(self) -> Sequence[str]:
        """Return what is allowed but should be known beforehand; ``labcrane check`` says it."""
        return ()


def _beside(path: Path, info: ValidationInfo) -> Path:
    return info.context["folder"] / path if info.context else path


StudyPath = Annotated[Path, AfterValidator(_beside)]
"""A file of the study in a component's settings: a relative path counts from the folder of the
protocol that names it."""
