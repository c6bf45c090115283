"""A crane without an engine: every joint moves exactly at the speed its actuator gives."""

from collections.abc import Sequence

from labcrane import FloatArray
from labcrane.core import Crane, Kernel


class KinematicCrane(Crane):
    """The velocity law itself: the reference for every engine.

    Speeds are integrated exactly. A joint that reaches its limit stops there, with speed zero.
    """

    def kernel(self) -> Kernel:
        return self.law_kernel()

    def _stand(self, angles: Sequence[float], speeds: Sequence[float]) -> None:
        self._angles = list(angles)

    def _place(self, angles: Sequence[float]) -> None:
        self._angles = list(angles)

    def _move(self, speeds: Sequence[float]) -> FloatArray:
        return self._turn(self._angles, list(speeds))
