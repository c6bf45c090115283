"""Contract tests, one class per role, which a plugin's tests subclass.

    class TestMyStick(InputContract):
        @pytest.fixture
        def device(self) -> InputDevice:
            return MyStick(MySettings(), ch8())

In comes a component that is built and not yet open, which the fixture returns; out go failures that
name the promise it breaks. Each contract opens it beside stand-ins for the other roles.
"""

from labcrane.testing.captures import CaptureContract
from labcrane.testing.commands import CommandContract
from labcrane.testing.components import PluginContract, check_closes_after_failed_open, check_soon
from labcrane.testing.estimates import EstimateContract
from labcrane.testing.examinations import ExaminationContract
from labcrane.testing.exporters import PARTICIPANT_TRIALS, ExporterContract, make_participant
from labcrane.testing.kernels import KernelContract
from labcrane.testing.monitors import SignalMonitorContract
from labcrane.testing.presentation import TARGETS, CueContract, FeedbackContract, make_target
from labcrane.testing.questionnaires import QuestionnaireContract
from labcrane.testing.roles import (
    RATE_HZ,
    STICKS,
    ControllerContract,
    DynamicsContract,
    InputContract,
    ch8,
    check_array,
    check_signals,
    crane_at,
    crane_state,
    make_frame,
    make_run,
    make_trial,
    opened,
)
from labcrane.testing.secondary import SecondaryTaskContract
from labcrane.testing.tasks import TaskContract
from labcrane.testing.triggers import TriggerContract

__all__ = [
    "PARTICIPANT_TRIALS",
    "RATE_HZ",
    "STICKS",
    "TARGETS",
    "CaptureContract",
    "CommandContract",
    "ControllerContract",
    "CueContract",
    "DynamicsContract",
    "EstimateContract",
    "ExaminationContract",
    "ExporterContract",
    "FeedbackContract",
    "InputContract",
    "KernelContract",
    "PluginContract",
    "QuestionnaireContract",
    "SecondaryTaskContract",
    "SignalMonitorContract",
    "TaskContract",
    "TriggerContract",
    "ch8",
    "check_array",
    "check_closes_after_failed_open",
    "check_signals",
    "check_soon",
    "crane_at",
    "crane_state",
    "make_frame",
    "make_participant",
    "make_run",
    "make_target",
    "make_trial",
    "opened",
]
