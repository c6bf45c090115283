"""Shared control: a second pair of hands beside the operator's, and a scheme that blends both.

The assistant is an input device. Its axes are recorded with the operator's, so that a replay needs
no assistant, and they go through a scheme of their own, made like the operator's. So what the
assistant asks for has the same limits, and a blend of two commands within a limit is within it.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from labcrane.core.by_estimate import ByEstimate, Following
from labcrane.core.clock import Tick
from labcrane.core.primitives import Sphere
from labcrane.core.records import Frame, Run, Trial, Value
from labcrane.core.roles import Controller, InputDevice
from labcrane.core.signals import Layout, signals_of
from labcrane.errors import ProtocolError
from labcrane.protocol.protocol import ASSIST, Assist
from labcrane.types import FloatArray

OF_ASSISTANT = f"{ASSIST}."
"""What the names of the assistant's axes begin with."""

SALT = 4
"""Keeps what an assistant draws by chance apart from what a simulated operator draws."""

PRESSED = 0.5
"""Value of a button above which it is down."""


class FourHands(InputDevice):
    """The operator's input device and the assistant's, whose axes follow as ``assist.left.x``.

    Parameters
    ----------
    inverse
        As :attr:`Run.inverse`, for the assistant's axes.
    """

    def __init__(
        self,
        operator: InputDevice,
        assistant: InputDevice,
        inverse: Callable[[FloatArray, FloatArray], FloatArray],
    ) -> None:
        self._operator, self._assistant, self._inverse = operator, assistant, inverse
        self.signals = (
            *operator.signals,
            *(replace(each, name=OF_ASSISTANT + each.name) for each in assistant.signals),
        )

    @property
    def fault(self) -> str | None:  # type: ignore[override]  # either device has its own
        """Why one of the two devices cannot be trusted now."""
        return self._operator.fault or self._assistant.fault

    def open(self, run: Run) -> None:
        operators, assistants = _each_ones(run.axes)
        self._operator.open(replace(run, axes=operators))
        seed = _other(run.participant_seed)
        self._assistant.open(
            replace(run, axes=assistants, inverse=self._inverse, participant_seed=seed)
        )

    def begin_trial(self, trial: Trial) -> None:
        self._operator.begin_trial(trial)
        self._assistant.begin_trial(replace(trial, seed=_other(trial.seed)))

    def close(self) -> None:
        with ExitStack() as closing:
            closing.callback(self._operator.close)
            closing.callback(self._assistant.close)

    def metadata(self) -> Mapping[str, Value]:
        own = {OF_ASSISTANT + name: value for name, value in self._assistant.metadata().items()}
        return {**self._operator.metadata(), **own}

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        return np.concatenate([self._operator.read(tick, seen), self._assistant.read(tick, seen)])


def _other(seed: int) -> int:
    return int(np.random.default_rng([seed, SALT]).integers(2**32))


class Assisted(Controller):
    """A scheme whose signals per joint are a blend of the operator's and the assistant's.

    All else of it, such as which of two schemes is active, is the operator's. It has no compiled
    kernel.

    Parameters
    ----------
    scheme, second
        The scheme of the operator, and another like it of the assistant: either may have a state.
    """

    def __init__(self, scheme: Controller, second: Controller, assist: Assist) -> None:
        self._scheme, self._second, self._assist = scheme, second, assist
        layout = Layout("the scheme", scheme.signals)
        joints = next((each for each in scheme.signals if each.name == "command"), None)
        if joints is None:
            raise ProtocolError(
                f"assist blends the signal 'command' of a scheme; this one has {layout.columns}"
            )
        self.signals = (*scheme.signals, *assist.signals(joints.components))
        self.inverse_of_assistant = second.inverse
        self._joints, self._size = layout.find("command"), layout.size
        # Whatever drives the machine: joint speeds, or signals of valves.
        self._blended = np.array(
            [
                layout.index(column)
                for each in scheme.signals
                if each.components == joints.components
                for column in each.columns
            ]
        )
        self._out = np.zeros(Layout("the scheme", self.signals).size)
        self._adaptive = isinstance(assist.share, ByEstimate)
        self._share = Following(0.0 if isinstance(assist.share, dict) else assist.share)

    def open(self, run: Run) -> None:
        operators, assistants = _each_ones(run.axes)
        self._axes = operators.size
        takeover = self._assist.takeover
        self._takeover = operators.index(takeover) if takeover else None
        self._share.open(operators)
        self._tick_s = 1.0 / run.rate_hz
        self._scheme.open(replace(run, axes=operators))
        self._second.open(replace(run, axes=assistants))

    def begin_trial(self, trial: Trial) -> None:
        if not self._adaptive:
            self._share = Following(self._assist.share_in(trial))
        self._scheme.begin_trial(trial)
        self._second.begin_trial(trial)

    def close(self) -> None:
        with ExitStack() as closing:
            closing.callback(self._scheme.close)
            closing.callback(self._second.close)

    def metadata(self) -> Mapping[str, Value]:
        return self._scheme.metadata()

    def attainable(self, places: Sequence[Sphere]) -> Mapping[str, float]:
        return self._scheme.attainable(places)

    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        own = self._scheme.command(axes[: self._axes], state)
        theirs = self._second.command(axes[self._axes :], state)
        share = self._share.after(self._tick_s, axes)
        pressed = self._takeover is not None and axes[self._takeover] > PRESSED
        return self._logged(own, 0.0 if pressed else share, theirs)

    def idle(self) -> FloatArray:
        return self._logged(self._scheme.idle(), 0.0, self._second.idle()).copy()

    def inverse(self, velocity: FloatArray, state: FloatArray) -> FloatArray:
        return self._scheme.inverse(velocity, state)

    def _logged(self, own: FloatArray, share: float, theirs: FloatArray) -> FloatArray:
        out, size, blended = self._out, self._size, self._blended
        out[:size] = own
        out[size] = share
        out[size + 1 :] = np.concatenate([own[self._joints], theirs[self._joints]])
        if share:  # without one, no rounding and no sign of a zero is another than the operator's
            out[blended] = (1.0 - share) * own[blended] + share * theirs[blended]
        return out


def _each_ones(axes: Layout) -> tuple[Layout, Layout]:
    """Return the operator's and the assistant's part of the axes of both."""
    units = dict(zip(axes.columns, axes.units, strict=True))
    own = [name for name in axes.columns if not name.startswith(OF_ASSISTANT)]
    theirs = {name.removeprefix(OF_ASSISTANT): units[name] for name in axes.columns[len(own) :]}
    return (
        Layout("the input", signals_of(own, units)),
        Layout("the assistant", signals_of(tuple(theirs), theirs)),
    )
