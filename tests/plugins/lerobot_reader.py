"""Reads a data set by the published lerobot, in the Python that has it; prints what it holds."""

import json
import os
import sys

os.environ["HF_HUB_OFFLINE"] = "1"

from lerobot.datasets.lerobot_dataset import LeRobotDataset

dataset = LeRobotDataset("labcrane/study", root=sys.argv[1])
images = dataset.meta.camera_keys
rows = {}
for at in map(int, sys.argv[2:]):
    row = dataset[at]
    rows[at] = {
        name: row[name].numpy().astype("<f4").tobytes().hex()
        for name in ("observation.state", "action")
    } | {"task": row["task"], "episode": int(row["episode_index"])}
    for name in images:  # red, green and blue first, 0 to 1
        pixels = (row[name].permute(1, 2, 0) * 255.0).round().byte().contiguous()
        rows[at][name] = pixels.numpy().tobytes().hex()
answer = {"frames": len(dataset), "episodes": dataset.num_episodes, "rows": rows}
sys.stdout.write(json.dumps(answer) + "\n")
