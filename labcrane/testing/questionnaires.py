"""Contract of questionnaires."""

import numpy as np

from labcrane.core.roles import Questionnaire


class QuestionnaireContract:
    """What every questionnaire must do. Provide the fixture ``questionnaire``."""

    def test_items_take_their_ends_and_nothing_beyond(self, questionnaire: Questionnaire) -> None:
        items = questionnaire.items()
        assert items
        assert len({item.name for item in items}) == len(items), "two items share a name"
        for item in items:
            assert item.name.isidentifier()
            assert item.name.islower()
            for answer in item.choices or (item.lowest, item.highest):
                assert item.kind == "text" or item.check(answer) == answer

    def test_scores_stay_in_their_ranges(self, questionnaire: Questionnaire) -> None:
        assert questionnaire.rights
        declared = {score.name: score for score in questionnaire.scores}
        for end in ("lowest", "highest"):
            items = questionnaire.items()
            answers = {i.name: i.choices[0] if i.choices else getattr(i, end) for i in items}
            scores = questionnaire.score(answers)
            assert scores.keys() == declared.keys()
            for name, value in scores.items():
                assert declared[name].lowest - 1e-9 <= value <= declared[name].highest + 1e-9

    def test_nothing_is_made_up_for_missing_answers(self, questionnaire: Questionnaire) -> None:
        assert all(np.isnan(value) for value in questionnaire.score({}).values())
