"""Questionnaires of human-factors studies, and a form for a lab's own.

Text is shipped only where its rights allow it; what may not be passed on comes from a file of the
lab's, and only the scoring is here.
"""

from labcrane import Machine, Offer, Questionnaire, hookimpl, offer
from labcrane_questionnaires.settings import (
    DemographicsSettings,
    FreeSettings,
    LabTextSettings,
    RatingSettings,
    SusSettings,
    TlxSettings,
    WordedSettings,
)

labcrane_api = 1


@hookimpl
def labcrane_questionnaires() -> list[Offer[Questionnaire]]:
    about_you = "labcrane_questionnaires.demographics:Demographics"
    return [
        offer("nasa_tlx", TlxSettings, "labcrane_questionnaires.tlx:NasaTlx"),
        offer("sus", SusSettings, "labcrane_questionnaires.sus:Sus"),
        _rating("subjective_accuracy"),
        _rating("situational_awareness"),
        offer("demographics", DemographicsSettings, about_you),
        offer("free", FreeSettings, "labcrane_questionnaires.free:Free"),
        _from_the_lab("sart", LabTextSettings),
        *(_from_the_lab(name, WordedSettings) for name in ("ssq", "borg_cr10", "borg_rpe", "kss")),
    ]


def _rating(name: str) -> Offer[Questionnaire]:
    def build(settings: RatingSettings, machine: Machine) -> Questionnaire:
        from labcrane_questionnaires.rating import Rating

        return Rating(name, settings)

    return offer(name, RatingSettings, build)


def _from_the_lab(name: str, settings: type[LabTextSettings]) -> Offer[Questionnaire]:
    def build(settings: LabTextSettings, machine: Machine) -> Questionnaire:
        from labcrane_questionnaires import licensed_scales, sart, ssq

        makers = {"ssq": ssq.Ssq, "sart": sart.Sart, **licensed_scales.SLOTS}
        return makers[name](settings.text)

    return offer(name, settings, build)
