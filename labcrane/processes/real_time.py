"""Real-time scheduling of a loop: above all ordinary programs, in memory, on a core of its own.

Linux gives ``SCHED_FIFO`` to whom ``/etc/security/limits.d`` allows it. RealtimeKit, which gives it
to anybody at a desk, kills a process that computes for 200 ms on end; a recording is not put at
that risk. Windows gives a multimedia class (MMCSS) and timers of a millisecond: written after its
documentation, and not tried on Windows itself.
"""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

from labcrane.errors import DeviceError

PRIORITY = 20
"""Above sound's 1 and JACK's 5 or 10: a tick takes a fraction of a block of sound."""

MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4


@dataclass(frozen=True, slots=True)
class Granted:
    """Priorities that the system has granted a loop, in words for the record.

    Attributes
    ----------
    priority
        Of the loop's thread; its other threads stay ordinary.
    memory
        Whether what the loop uses may be swapped out to a disk.
    core
        Which processor core it has, and whether others leave it alone.
    """

    priority: str
    memory: str
    core: str


if sys.platform == "linux":

    @contextmanager
    def reserved_core() -> Iterator[int | None]:
        """Leave the last core that this process may use to a loop; None if it is the only one.

        The calling thread, and processes that it starts meanwhile, use the others.
        """
        everywhere = sorted(os.sched_getaffinity(0))
        *others, last = everywhere
        if not others:
            yield None
            return
        os.sched_setaffinity(0, others)
        try:
            yield last
        finally:
            os.sched_setaffinity(0, everywhere)

    @contextmanager
    def real_time(core: int | None) -> Iterator[Granted]:
        """Schedule the calling thread in real time; threads it starts stay ordinary.

        Parameters
        ----------
        core
            The core that :func:`reserved_core` has left to it; None for any.

        Raises
        ------
        DeviceError
            This user may not have such priorities.
        """
        everywhere = os.sched_getaffinity(0)
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        try:
            os.sched_setscheduler(0, policy, os.sched_param(PRIORITY))
        except PermissionError:
            raise DeviceError(
                "--real-time: this user may have no real-time priorities; write "
                f"'@labcrane - rtprio {PRIORITY}' and '@labcrane - memlock unlimited' into "
                "/etc/security/limits.d/labcrane.conf, join the group labcrane, and log in again; "
                "or run without --real-time"
            ) from None
        try:
            if core is not None:
                os.sched_setaffinity(0, {core})
            yield Granted(f"SCHED_FIFO {PRIORITY}", _kept_in_memory(), _said_of(core))
        finally:
            _let_go_of_memory()
            os.sched_setaffinity(0, everywhere)
            os.sched_setscheduler(0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0))

    def _kept_in_memory() -> str:
        """Keep what is used from now on in memory; without room for it, allocating would fail."""
        import resource  # noqa: PLC0415 - not on Windows

        most = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
        if most != resource.RLIM_INFINITY and os.geteuid() != 0:
            return f"may be swapped out: at most {most / 1e6:.0f} MB may be locked"
        if ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT):
            return "may be swapped out: the system refused to lock it"
        return "is never swapped out"

    def _let_go_of_memory() -> None:
        ctypes.CDLL(None).munlockall()

elif sys.platform == "win32":
    HIGH_PRIORITY_CLASS = 0x80

    @contextmanager
    def reserved_core() -> Iterator[int | None]:
        """Leave no core to a loop: MMCSS chooses."""
        yield None

    @contextmanager
    def real_time(core: int | None) -> Iterator[Granted]:
        """Give the calling thread to the multimedia class scheduler, and timers of 1 ms.

        Raises
        ------
        DeviceError
            The service does not run.
        """
        avrt, kernel, winmm = (ctypes.WinDLL(each) for each in ("avrt", "kernel32", "winmm"))
        avrt.AvSetMmThreadCharacteristicsW.restype = ctypes.c_void_p
        avrt.AvRevertMmThreadCharacteristics.argtypes = [ctypes.c_void_p]
        kernel.GetCurrentProcess.restype = ctypes.c_void_p
        kernel.SetPriorityClass.argtypes = [ctypes.c_void_p, ctypes.c_uint32]
        task = ctypes.c_uint32(0)
        thread = avrt.AvSetMmThreadCharacteristicsW("Pro Audio", ctypes.byref(task))
        if not thread:
            raise DeviceError(
                "--real-time: the Multimedia Class Scheduler does not run; start the service MMCSS "
                "(sc start MMCSS), or run without --real-time"
            )
        kernel.SetPriorityClass(kernel.GetCurrentProcess(), HIGH_PRIORITY_CLASS)
        winmm.timeBeginPeriod(1)
        try:
            yield Granted("MMCSS Pro Audio, high class", "as the system does", _said_of(core))
        finally:
            winmm.timeEndPeriod(1)
            avrt.AvRevertMmThreadCharacteristics(thread)

else:

    @contextmanager
    def reserved_core() -> Iterator[int | None]:
        """Leave no core to a loop: this system does not pin threads."""
        yield None

    def real_time(core: int | None) -> AbstractContextManager[Granted]:
        """Refuse: this system's time constraints are not built.

        Raises
        ------
        DeviceError
            Always.
        """
        raise DeviceError(
            "--real-time: labcrane has it for Linux and Windows; run without --real-time"
        )


def _said_of(core: int | None) -> str:
    return (
        "any, and shared"
        if core is None
        else f"core {core}, which other labcrane processes do not use"
    )
