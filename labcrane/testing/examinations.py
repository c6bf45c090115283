"""The contract of examinations: how a plugin looks at the hardware of its component."""

from labcrane.core.findings import Finding, Verdict
from labcrane.core.roles import Component
from labcrane.core.settings import Settings
from labcrane.registry.offers import Offer


class ExaminationContract:
    """What every examination must do. Provide the fixtures ``offered`` and ``settings``.

    It is run on the computer that tests, whether the hardware is there or not.
    """

    def test_every_finding_says_how_it_is_and_what_to_do(
        self, offered: Offer[Component], settings: Settings
    ) -> None:
        assert offered.examine is not None, _lacking(offered)
        found = list(offered.examine(settings, None))
        assert found, (
            f"the examination of {offered.name!r} found nothing; yield one Finding at least, of "
            "Verdict.PASS when all is well"
        )
        for finding in found:
            where = f"the examination of {offered.name!r}"
            assert isinstance(finding, Finding), (
                f"{where} yielded {finding!r}; yield Finding(verdict, text, advice)"
            )
            assert finding.text, (
                f"{where} yielded {finding} without a text; write what was looked at and what it "
                "is like"
            )
            if finding.verdict is not Verdict.PASS:
                assert finding.advice, (
                    f"{where} reports {finding.text!r} without advice on what to do about it; give "
                    "the Finding an advice"
                )
            for name, text in (("text", finding.text), ("advice", finding.advice)):
                assert not text.endswith("."), (
                    f"{where} yielded a Finding whose {name} ends with a full stop: {text!r}; "
                    "leave it out, for it is printed as part of a line"
                )

    def test_it_can_be_made_again(self, offered: Offer[Component], settings: Settings) -> None:
        assert offered.examine is not None, _lacking(offered)
        first, again = (list(offered.examine(settings, None)) for _ in range(2))
        before, after = ([str(one.verdict) for one in found] for found in (first, again))
        assert before == after, (
            f"the examination of {offered.name!r} gave {before}, and {after} when it was made once "
            "more; close what it opens, and keep nothing from one time to the next"
        )


def _lacking(offered: Offer[Component]) -> str:
    return (
        f"{offered.name!r} has no examination; give one with offer(..., examine=...), or do not "
        "test this contract"
    )
