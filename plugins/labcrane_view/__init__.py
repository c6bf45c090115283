"""The crane in a forest, in 3-D: windows for the operator, the experimenter and the mirror."""

from collections.abc import Sequence

from labcrane import Feedback, Machine, Offer, hookimpl, offer
from labcrane.core import Finding
from labcrane.registry import LAB, Prompt
from labcrane_view.settings import ViewSettings

labcrane_api = 1


@hookimpl
def labcrane_feedback() -> list[Offer[Feedback]]:
    def build(settings: ViewSettings, machine: Machine) -> Feedback:
        from labcrane_view.view import View

        return View(settings, machine)

    def examine(settings: ViewSettings, ask: Prompt | None) -> Sequence[Finding]:
        from labcrane_view import examination

        return examination.examine(settings, ask)

    return [offer("view", ViewSettings, build, examine, needs={"panda3d": LAB})]
