"""Contract of every component, whatever its role, and of every plugin."""

import time
from collections.abc import Callable
from contextlib import suppress
from types import ModuleType

import numpy as np
from pydantic import ValidationError

from labcrane.core.records import Run
from labcrane.core.roles import Component
from labcrane.core.signals import Layout
from labcrane.errors import LabcraneError
from labcrane.machines.library import load_machine
from labcrane.registry.offers import API, CommandOffer, Offer

TICK_S = 1.0 / 240.0
"""What a method that runs every tick may take, half of the time: the slowest rate anybody runs."""


def check_soon(method: Callable[[], object], calls: int = 50) -> None:
    """Check that a method leaves time for the others of a tick; the first call may be slow.

    The fastest call counts: what else runs on the computer makes calls slower, and none faster.
    """
    took = []
    for _ in range(calls):
        began = time.perf_counter()
        method()
        took.append(time.perf_counter() - began)
    least = min(took)
    assert least < TICK_S / 2, (
        f"a call takes {1000 * least:.1f} ms at least, and must return at once: a tick at 240 Hz "
        f"has {1000 * TICK_S:.1f} ms for everything"
    )


def check_closes_after_failed_open(component: Component) -> None:
    """Check that a component closes though nothing was there that it looked for in ``open``.

    What it lacks it must say in one of labcrane's errors.
    """
    empty = Layout("nothing", ())
    machine = load_machine("ch8")
    run = Run(240.0, machine, 1, empty, empty, empty, empty, lambda velocity, state: np.empty(0))
    try:
        with suppress(LabcraneError):
            component.open(run)
    finally:
        component.close()


class PluginContract:
    """What every plugin must do. Provide the fixture ``plugin``: the module with its hooks."""

    def test_plugin_says_for_which_interface_it_is_built(self, plugin: ModuleType) -> None:
        assert getattr(plugin, "labcrane_api", None) == API, f"write labcrane_api = {API}"

    def test_offers_have_names_that_a_protocol_can_write(self, plugin: ModuleType) -> None:
        offers = _offers(plugin)
        assert offers or _commands(plugin), "no hook of labcrane offers anything"
        for offer in offers:
            assert offer.name.isidentifier(), (
                f"{offer.name!r} cannot be written in a protocol; use letters, digits and _"
            )
            assert offer.name.islower(), f"write {offer.name.lower()!r} instead of {offer.name!r}"

    def test_every_setting_says_what_it_means(self, plugin: ModuleType) -> None:
        for offer in _offers(plugin):
            name = offer.settings.__name__
            assert offer.settings.__doc__, (
                f"{name} needs a docstring: write what {offer.name!r} is, in a sentence, below "
                f"'class {name}(Settings):'"
            )
            schema = offer.settings.model_json_schema()
            for name, setting in schema.get("properties", {}).items():
                said = setting.get("description")
                assert said, (
                    f"{offer.settings.__name__}.{name} needs a docstring: write what it is, with "
                    "its unit, on the line below it"
                )

    def test_settings_refuse_keys_that_they_do_not_have(self, plugin: ModuleType) -> None:
        for offer in _offers(plugin):
            try:
                offer.settings.model_validate({"no_such_setting": 1})
            except ValidationError:
                continue
            raise AssertionError(f"{offer.settings.__name__} must subclass labcrane.Settings")


def _offers(plugin: ModuleType) -> list[Offer[Component]]:
    hooks = [each for name, each in vars(plugin).items() if name.startswith("labcrane_")]
    found = [each for hook in hooks if callable(hook) for each in hook()]
    return [each for each in found if isinstance(each, Offer)]


def _commands(plugin: ModuleType) -> list[CommandOffer]:
    hook = getattr(plugin, "labcrane_commands", None)
    return list(hook()) if hook else []
