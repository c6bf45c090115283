"""Opens a view with keys and presents frames until the input ends, as a feedback process does."""

import select
import sys
from pathlib import Path

from labcrane.feedback.config import ComponentConfig, FeedbackConfig
from labcrane.feedback.presenter import Presenter
from labcrane.streams.feedback_log import FeedbackLog
from labcrane.testing import TARGETS, ch8, discover, make_run, make_target

name = sys.argv[1]
run = make_run(ch8(), task=TARGETS)
settings = {"size": (400, 300), "keys": ("a", "d", "arrow_up", "arrow_down"), "hud": ()}
order = FeedbackConfig(
    name, ComponentConfig("view", settings), run, "a/test", Path("study.yaml"), always=True
)
presenter = Presenter(order, discover())
presenter.open()
log = FeedbackLog(name, "a/test", presenter)
number = 0
while not select.select([sys.stdin], [], [], 0.01)[0]:
    number += 1
    frame = make_target(run, number)
    log.push(frame, presenter.present(frame), 0, presenter.feedback.samples())
    if number == 3:
        sys.stdout.write("ready\n")
        sys.stdout.flush()
presenter.close()
