"""Rescue scenarios: scenes with objects, a human figure and goals, run and judged."""

from labcrane import InputDevice, Machine, Offer, Task, hookimpl, offer
from labcrane_scenario.settings import PanelOperatorSettings, ScenarioSettings

labcrane_api = 1


@hookimpl
def labcrane_tasks() -> list[Offer[Task]]:
    def scenario(settings: ScenarioSettings, machine: Machine) -> Task:
        from labcrane_scenario.scenario import Scenario

        return Scenario(settings, machine)

    return [offer("scenario", ScenarioSettings, scenario)]


@hookimpl
def labcrane_inputs() -> list[Offer[InputDevice]]:
    def operator(settings: PanelOperatorSettings, machine: Machine) -> InputDevice:
        from labcrane_scenario.operator import ScenarioOperator

        return ScenarioOperator(settings, machine)

    return [offer("scenario_operator", PanelOperatorSettings, operator)]
