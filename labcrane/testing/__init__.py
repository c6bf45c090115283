"""Contract tests, one class per role, which a plugin's tests subclass, and a session for a test.

    class TestMyStick(InputContract):
        @pytest.fixture
        def device(self) -> InputDevice:
            return MyStick(MySettings(), ch8())

In comes a component that is built and not yet open, which the fixture returns; out go failures that
name the promise it breaks. Each contract opens it beside stand-ins for the other roles. What a test
of a whole study needs is here as well: its protocol read, its plan, a session of it, a command.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
