"""Contract of questionnaires."""

import numpy as np

from labcrane.core.roles import Questionnaire


class QuestionnaireContract:
    """What every questionnaire must do. Provide the fixture ``questionnaire``."""

    def test_items_take_their_ends_and_nothing_beyond(self, questionnaire: Questionnaire) -> None:
        items = questionnaire.items()
        assert items, "items() must return one question at least"
        assert len({item.name for item in items}) == len(items), "two items share a name"
        for item in items:
            fine = item.name.isidentifier() and item.name.islower()
            assert fine, f"item {item.name!r}: use small letters, digits and _"
            for answer in item.choices or (item.lowest, item.highest):
                fine = item.kind == "text" or item.check(answer) == answer
                assert fine, f"item {item.name!r} does not take {answer!r} as it is"

    def test_scores_stay_in_their_ranges(self, questionnaire: Questionnaire) -> None:
        assert questionnaire.rights, "rights must say who may use the questionnaire"
        declared = {score.name: score for score in questionnaire.scores}
        for end in ("lowest", "highest"):
            items = questionnaire.items()
            answers = {i.name: i.choices[0] if i.choices else getattr(i, end) for i in items}
            scores = questionnaire.score(answers)
            assert scores.keys() == declared.keys(), (
                f"score() has {sorted(scores)}; scores are {sorted(declared)}"
            )
            for name, value in scores.items():
                low, high = declared[name].lowest, declared[name].highest
                assert low - 1e-9 <= value <= high + 1e-9, f"{name} is {value}, not {low} to {high}"

    def test_nothing_is_made_up_for_missing_answers(self, questionnaire: Questionnaire) -> None:
        scores = questionnaire.score({})
        assert all(np.isnan(value) for value in scores.values()), (
            f"without answers every score must be NaN, not {scores}"
        )
