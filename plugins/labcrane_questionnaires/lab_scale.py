"""A questionnaire with one kind of scale, whose words the lab brings."""

from collections.abc import Sequence

from labcrane import ProtocolError, Questionnaire
from labcrane.core import Item
from labcrane_questionnaires.settings import LabText, unstepped


class LabScale(Questionnaire):
    """Items on one scale, named by the scoring and worded by the lab's file."""

    usual_title: str
    names: tuple[str, ...]
    span: tuple[float, float, float]
    """Lowest and highest answer, and the step."""

    def __init__(self, text: LabText) -> None:
        if len(text.items) != len(self.names):
            raise ProtocolError(
                f"{self.usual_title} has {len(self.names)} items, and the lab's file has "
                f"{len(text.items)}; give them in the order of the publication"
            )
        lowest, highest, step = self.span
        if wrong := unstepped(text.words, lowest, highest, step):
            raise ProtocolError(f"{self.usual_title} {wrong}")
        self.title = text.title or self.usual_title
        self.rights = text.rights
        self._text = text

    def items(self) -> Sequence[Item]:
        return [
            Item(
                name,
                asked,
                "scale",
                *self.span,
                left=self._text.left,
                right=self._text.right,
                words=tuple(self._text.words.items()),
            )
            for name, asked in zip(self.names, self._text.items, strict=True)
        ]
