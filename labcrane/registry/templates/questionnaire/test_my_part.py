"""my_part keeps the contract of its role; add what else it promises."""

import pytest
from my_module import MyPart, MyPartSettings

from labcrane import Questionnaire
from labcrane.testing import QuestionnaireContract


class TestMyPart(QuestionnaireContract):
    @pytest.fixture
    def questionnaire(self) -> Questionnaire:
        return MyPart(MyPartSettings())


def test_the_score_is_the_mean_as_a_share_of_the_scale() -> None:
    questionnaire = MyPart(MyPartSettings(steps=5))
    assert questionnaire.score({"easy": 4.0, "sure": 1.0}) == {"ease": 0.625}
