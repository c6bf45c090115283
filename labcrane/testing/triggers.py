"""Contract of triggers: lines that report events to other devices."""

import time

import pytest

from labcrane.core.records import Echo
from labcrane.core.roles import Trigger
from labcrane.testing.components import check_closes_after_failed_open, check_soon
from labcrane.testing.roles import ch8, make_run, opened

HIGHEST = 255


class TriggerContract:
    """What every trigger must do. Provide the fixture ``trigger``: built, and not yet open.

    Its device, or a stand-in for it, is there.
    """

    @pytest.fixture
    def trigger(self) -> Trigger:
        raise NotImplementedError

    def test_codes_fit_eight_lines(self, trigger: Trigger) -> None:
        for event, code in (trigger.codes or {}).items():
            assert 1 <= code <= HIGHEST, (
                f"the code of {event!r} is {code}; give it one of 1 to {HIGHEST}: eight lines "
                "carry no more, and 0 is rest"
            )

    def test_codes_are_sent_without_waiting(self, trigger: Trigger) -> None:
        with opened(trigger, make_run(ch8())):
            check_soon(lambda: trigger.send([HIGHEST], time.perf_counter()))
            check_soon(lambda: trigger.send([], time.perf_counter()))
            assert trigger.fault is None, (
                f"after codes were sent its fault is {trigger.fault!r}; a fault is for a device "
                "that is gone"
            )

    def test_what_comes_back_are_echoes_of_the_time_at_which_they_came(
        self, trigger: Trigger
    ) -> None:
        with opened(trigger, make_run(ch8())):
            began = time.perf_counter()
            found = [*trigger.send([7], began), *trigger.send([], time.perf_counter())]
            for echo in found:
                assert isinstance(echo, Echo), f"send() returned {echo!r}; return Echo(code, time)"
                assert began <= echo.time <= time.perf_counter(), (
                    f"an echo came at {echo.time} s, and the code was sent at {began} s; stamp it "
                    "with time.perf_counter()"
                )

    def test_it_closes_though_it_was_not_opened(self, trigger: Trigger) -> None:
        check_closes_after_failed_open(trigger)
