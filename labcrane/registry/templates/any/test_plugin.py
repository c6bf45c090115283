"""my_part keeps the contract of plugins."""

from types import ModuleType

import my_module
import pytest

from labcrane.testing import PluginContract


class TestPlugin(PluginContract):
    @pytest.fixture
    def plugin(self) -> ModuleType:
        return my_module
