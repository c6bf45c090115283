"""The crane in a forest, in 3-D: windows for the operator, the experimenter and the mirror."""

from labcrane import Feedback, Offer, hookimpl, offer
from labcrane.registry import LAB
from labcrane_view.settings import ViewSettings

labcrane_api = 1


@hookimpl
def labcrane_feedback() -> list[Offer[Feedback]]:
    view, examine = "labcrane_view.view:View", "labcrane_view.examination:examine"
    return [offer("view", ViewSettings, view, examine, needs={"panda3d": LAB})]
