"""Commands in processes of their own, and what each of them used itself."""

import json
import resource
import subprocess
import sys
from dataclasses import dataclass

PROGRAM = """
import json, sys, time
from pathlib import Path
from labcrane.cli.app import main
began = time.perf_counter()
status = main(sys.argv[1:])
took = time.perf_counter() - began
used = time.process_time()
lines = Path("/proc/self/status").read_text().splitlines()
(most,) = (int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))
print(json.dumps([took, used, most / 1024]))
sys.exit(status)
"""
# ru_maxrss would not do: a program inherits it from the process that started it.


@dataclass(frozen=True)
class Use:
    """What a command used: seconds by the clock and of the processor, and MB at most."""

    seconds: float
    processor_s: float
    megabytes: float


def used(*words: str) -> Use:
    """Run a labcrane command to its end; return what its own process used."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *words], check=True, capture_output=True, text=True
    )
    return Use(*json.loads(done.stdout.splitlines()[-1]))


def spent_s(*words: str) -> float:
    """Run a labcrane command to its end; return the processor's seconds, also of its workers."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = [sys.executable, "-m", "labcrane", *words]
    subprocess.run(run, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
