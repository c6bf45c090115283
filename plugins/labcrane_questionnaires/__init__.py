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
    def tlx(settings: TlxSettings, machine: Machine) -> Questionnaire:
        from labcrane_questionnaires.tlx import NasaTlx

        return NasaTlx(settings)

    def sus(settings: SusSettings, machine: Machine) -> Questionnaire:
        from labcrane_questionnaires.sus import Sus

        return Sus(settings)

    def rating(name: str) -> Offer[Questionnaire]:
        def build(settings: RatingSettings, machine: Machine) -> Questionnaire:
            from labcrane_questionnaires.rating import Rating

            return Rating(name, settings)

        return offer(name, RatingSettings, build)

    def demographics(settings: DemographicsSettings, machine: Machine) -> Questionnaire:
        from labcrane_questionnaires.demographics import Demographics

        return Demographics(settings)

    def free(settings: FreeSettings, machine: Machine) -> Questionnaire:
        from labcrane_questionnaires.free import Free

        return Free(settings)

    return [
        offer("nasa_tlx", TlxSettings, tlx),
        offer("sus", SusSettings, sus),
        rating("subjective_accuracy"),
        rating("situational_awareness"),
        offer("demographics", DemographicsSettings, demographics),
        offer("free", FreeSettings, free),
        _from_the_lab("sart", LabTextSettings),
        *(_from_the_lab(name, WordedSettings) for name in ("ssq", "borg_cr10", "borg_rpe", "kss")),
    ]


def _from_the_lab(name: str, settings: type[LabTextSettings]) -> Offer[Questionnaire]:
    def build(settings: LabTextSettings, machine: Machine) -> Questionnaire:
        from labcrane_questionnaires import licensed_scales, sart, ssq

        makers = {"ssq": ssq.Ssq, "sart": sart.Sart, **licensed_scales.SLOTS}
        return makers[name](settings.text)

    return offer(name, settings, build)
