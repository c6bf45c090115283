"""The crane in a forest, in 3-D: windows for the operator, the examiner and the mirror."""

from labcrane import Feedback, Machine, Offer, hookimpl, offer
from labcrane_view.settings import ViewSettings


@hookimpl
def labcrane_feedback() -> list[Offer[Feedback]]:
    def build(settings: ViewSettings, machine: Machine) -> Feedback:
        from labcrane_view.view import View

        return View(settings, machine)

    return [offer("view", ViewSettings, build)]
