"""Reads a data set by the published lerobot, in the Python that has it; prints what it holds."""

import json
import os
import sys

os.environ["HF_HUB_OFFLINE"] = "1"

from lerobot.datasets.lerobot_dataset import LeRobotDataset

dataset = LeRobotDataset("labcrane/study", root=sys.argv[1])
rows = {}
for at in map(int, sys.argv[2:]):
    row = dataset[at]
    rows[at] = {
        name: row[name].numpy().astype("<f4").tobytes().hex()
        for name in ("observation.state", "action")
    } | {"task": row["task"], "episode": int(row["episode_index"])}
answer = {"frames": len(dataset), "episodes": dataset.num_episodes, "rows": rows}
sys.stdout.write(json.dumps(answer) + "\n")
