"""What holds for every bundled plugin, and that the contracts notice those that break them."""

import importlib
import time
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import labcrane
from labcrane import Controller, DeviceError, FloatArray, InputDevice, Signal
from labcrane.testing import InputContract, PluginContract

BUNDLED = sorted(
    path.parent.name for path in (Path(__file__).parents[2] / "plugins").glob("*/__init__.py")
)


class TestBundled(PluginContract):
    @pytest.fixture(params=BUNDLED)
    def plugin(self, request: pytest.FixtureRequest) -> ModuleType:
        return importlib.import_module(request.param)


class Stick(InputDevice):
    """Keeps its contract; each subclass breaks it in one way."""

    signals = (Signal("left", "1", ("x",)),)

    def read(self, tick, seen) -> FloatArray:
        return np.zeros(1)


class Sleeps(Stick):
    def read(self, tick, seen):
        time.sleep(0.05)
        return np.zeros(1)


class NotANumber(Stick):
    def read(self, tick, seen):
        return np.array([np.nan])


class TooLong(Stick):
    def read(self, tick, seen):
        return np.zeros(2)


class Wide(Stick):
    def read(self, tick, seen):
        return np.array([1.5])


class Random(Stick):
    def read(self, tick, seen):
        return np.random.default_rng().uniform(-1, 1, 1)


class CannotClose(Stick):
    def open(self, run):
        raise DeviceError("nobody answers")

    def close(self):
        self.line.close()


BREACHES = {
    Sleeps: ("test_device_reads_at_once", "must return at once"),
    NotANumber: ("test_device_reads_what_its_signals_promise", "returned \\[nan\\]"),
    TooLong: ("test_device_reads_what_its_signals_promise", "promise shape \\(1,\\), got \\(2,\\)"),
    Wide: ("test_device_reads_what_its_signals_promise", "outside \\[-1, 1\\]"),
    Random: ("test_a_trials_seed_decides_all_that_is_random", "not equal"),
    CannotClose: ("test_device_closes_after_a_failed_open", "no attribute 'line'"),
}


@pytest.mark.slow
@pytest.mark.parametrize("breach", BREACHES)
def test_a_contract_notices_who_breaks_it(breach: type[InputDevice]) -> None:
    test, words = BREACHES[breach]
    with pytest.raises((AssertionError, AttributeError), match=words):
        getattr(InputContract(), test)(breach())


def test_a_contract_passes_who_keeps_it() -> None:
    for name in dir(InputContract):
        if name.startswith("test_"):
            getattr(InputContract(), name)(Stick())


def test_a_plugin_contract_notices_what_is_not_documented_or_not_said() -> None:
    class Bare(labcrane.Settings):
        """Nothing is said of its key."""

        gain: float = 1.0

    plugin = ModuleType("bare")
    offers = [labcrane.offer("bare", Bare, lambda settings, machine: Controller())]
    plugin.labcrane_controllers = lambda: offers
    contract = PluginContract()
    with pytest.raises(AssertionError, match="write labcrane_api = 1"):
        contract.test_plugin_says_for_which_interface_it_is_built(plugin)
    with pytest.raises(AssertionError, match=r"Bare\.gain needs a docstring: write what"):
        contract.test_every_setting_says_what_it_means(plugin)
    contract.test_settings_refuse_keys_that_they_do_not_have(plugin)
