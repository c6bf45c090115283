"""A hydraulic joint with a law of its own, recorded as the shared one is."""

import math
from pathlib import Path

import numpy as np
import pandas as pd

LEVELS = (*range(-240, 250, 10), -250, 250)
DEAD_BAND, DEAD_TIME, LAG = 22.0, 0.08, 0.12
LOW, HIGH = 0.0, math.radians(60.0)


def true_speed(signal: float, angle: float) -> float:
    """Return rad/s: a flow with a bend, over a lever arm that changes by half."""
    beyond = max(abs(signal) - DEAD_BAND, 0.0) / (250.0 - DEAD_BAND)
    flow = (6.0 if signal > 0 else 8.0) * beyond**1.15
    lever = 1.0 + 0.4 * math.sin(1.4 * angle) + 0.1 * angle
    return math.copysign(math.radians(flow) * lever, signal) if beyond else 0.0


def record(path: Path, seed: int = 5) -> None:
    random = np.random.default_rng(seed)
    tables = []
    for number, signal in enumerate(sorted(LEVELS)):
        angle, flow, dt, log = (HIGH if signal < 0 else LOW), 0.0, 0.002, []
        for step in range(round(150.0 / dt)):
            time = step * dt
            if step % 5 == 0:
                log.append((time, signal if time >= 0.5 else 0, angle))
            goal = 1.0 if time >= 0.5 + DEAD_TIME else 0.0
            flow += (1.0 - math.exp(-dt / LAG)) * (goal - flow)
            angle += dt * flow * true_speed(signal, angle)
            if not LOW <= angle <= HIGH or (abs(signal) <= DEAD_BAND and time > 2.0):
                break
        time, what, seen = map(np.array, zip(*log, strict=True))
        noisy = np.degrees(seen) + random.normal(0.0, 0.02, len(seen))
        rounded = np.round(noisy / 360 * 2**14) * 360 / 2**14
        columns = {"run": number, "time_s": time, "signal": what, "angle_deg": rounded}
        tables.append(pd.DataFrame(columns))
    pd.concat(tables).to_csv(path, index=False)
