"""Rescue scenarios: scenes with objects, a human figure and goals, run and judged."""

from labcrane import InputDevice, Offer, Task, hookimpl, offer
from labcrane_scenario.settings import PanelOperatorSettings, ScenarioSettings

labcrane_api = 1


@hookimpl
def labcrane_tasks() -> list[Offer[Task]]:
    return [offer("scenario", ScenarioSettings, "labcrane_scenario.scenario:Scenario")]


@hookimpl
def labcrane_inputs() -> list[Offer[InputDevice]]:
    operator = "labcrane_scenario.operator:ScenarioOperator"
    return [offer("scenario_operator", PanelOperatorSettings, operator)]
