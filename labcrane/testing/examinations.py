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
        assert offered.examine is not None, f"{offered.name} has no examination"
        found = list(offered.examine(settings, None))
        assert found, "an examination says something, at least that all is well"
        for finding in found:
            assert isinstance(finding, Finding), finding
            assert finding.text, finding
            assert not finding.text.endswith("."), finding
            if finding.verdict is not Verdict.PASS:
                assert finding.advice, f"nobody is told what to do about: {finding.text}"
            assert not finding.advice.endswith("."), finding

    def test_it_can_be_made_again(self, offered: Offer[Component], settings: Settings) -> None:
        assert offered.examine is not None
        first, again = (list(offered.examine(settings, None)) for _ in range(2))
        assert [one.verdict for one in first] == [one.verdict for one in again]
