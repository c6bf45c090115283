"""The public names, and the modules from which they are imported."""

from .captures import CaptureContract
from .commands import CommandContract
from .components import PluginContract, check_closes_after_failed_open, check_soon
from .estimates import EstimateContract
from .examinations import ExaminationContract
from .exporters import PARTICIPANT_TRIALS, ExporterContract, make_participant
from .kernels import KernelContract
from .monitors import SignalMonitorContract
from .presentation import TARGETS, CueContract, FeedbackContract, make_target
from .questionnaires import QuestionnaireContract
from .roles import (
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
from .secondary import SecondaryTaskContract
from .study import (
    Command,
    Order,
    QueueConsole,
    Registry,
    Study,
    Visit,
    discover,
    load,
    main,
    plan_session,
    run,
)
from .tasks import TaskContract
from .triggers import TriggerContract

__all__ = [
    "PARTICIPANT_TRIALS",
    "RATE_HZ",
    "STICKS",
    "TARGETS",
    "CaptureContract",
    "Command",
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
    "Order",
    "PluginContract",
    "QuestionnaireContract",
    "QueueConsole",
    "Registry",
    "SecondaryTaskContract",
    "SignalMonitorContract",
    "Study",
    "TaskContract",
    "TriggerContract",
    "Visit",
    "ch8",
    "check_array",
    "check_closes_after_failed_open",
    "check_signals",
    "check_soon",
    "crane_at",
    "crane_state",
    "discover",
    "load",
    "main",
    "make_frame",
    "make_participant",
    "make_run",
    "make_target",
    "make_trial",
    "opened",
    "plan_session",
    "run",
]
