"""Analysis: how long export and report take per participant, and how the time grows.

    python -m benchmarks.analysis [--participants 36] [--movements 4]

Records one simulated session for each length, copies it to the given number of participants, and
runs the report and two exports in separate processes. Time per participant, time per movement and
memory should not change when either number grows. Times are processor times, so that other
programs on the computer matter little. Cohorts of two sizes separate the first participant, for
whom libraries are loaded, from the others.
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import h5py

from benchmarks.own_process import Use, used
from benchmarks.table import Row

PROTOCOL = Path(__file__).parents[1] / "protocols" / "aiming" / "protocol.yaml"


def record(folder: Path, movements: int) -> Path:
    """Record one participant with eight pairs and so many movements each; return the file."""
    text = PROTOCOL.read_text(encoding="utf-8")
    text = text.replace("bullet_crane", "kinematic_crane")
    text = text.replace("movements: 4", f"movements: {movements}")
    folder.mkdir(parents=True)
    (folder / "instructions.md").write_text("Move.", encoding="utf-8")
    (folder / "protocol.yaml").write_text(text, encoding="utf-8")
    session = ["protocol.yaml", "--participant", "P001", "--simulate", "--fast", "--data", "data"]
    command = [sys.executable, "-m", "labcrane", "run", *session]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return folder / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5"


def multiply(recording: Path, folder: Path, count: int) -> Path:
    """Return a data folder with ``count`` participants, all with the same session."""
    for number in range(1, count + 1):
        name = f"P{number:03}-SIMULATED"
        (folder / name).mkdir(parents=True)
        path = folder / name / f"{name}.h5"
        shutil.copyfile(recording, path)
        with h5py.File(path, "r+") as file:  # a copy that names another participant is left out
            session = file["ses-01"]
            context = json.loads(session["context"][()]) | {"participant": name}
            del session["context"]
            session["context"] = json.dumps(context).encode()
            file.attrs["participant"] = session.attrs["participant"] = name
    return folder


PLAIN = """
import sys, time
from pathlib import Path
import h5py
import pyarrow as pa
from pyarrow import parquet
out = Path(sys.argv[2])
began = time.process_time()
files = sorted(Path(sys.argv[1]).glob("*/*.h5"))
for path in files:
    with h5py.File(path) as file:
        session = file["ses-01"]
        found = {"time": session["time"][:]}
        def take(name, node):
            if isinstance(node, h5py.Dataset):
                found[name] = node[:]
        for group in ("loop", "input", "command", "state", "task"):
            session[group].visititems(lambda name, node, of=group: take(f"{of}/{name}", node))
    parquet.write_table(pa.table(found), out / f"{path.stem}.parquet", use_dictionary=False)
print((time.process_time() - began) / len(files), len(found))
"""


def plain_s(data: Path) -> float:
    """Return the processor's seconds per participant for h5py to pyarrow, of every tick's columns.

    Raises
    ------
    ValueError
        There are fewer columns than a session has: a reference that reads nothing is fast.
    """
    with tempfile.TemporaryDirectory() as out:
        words = [sys.executable, "-c", PLAIN, str(data), out]
        seconds, columns = subprocess.check_output(words, text=True).split()
    if int(columns) < FEWEST:
        raise ValueError(f"only {columns} columns were written for comparison")
    return float(seconds)


FEWEST = 40
"""Columns that a session of the study has at least."""

COMMANDS = (("report",), ("export", "--to", "tables"))
REPORT_TIMES, EXPORT_TIMES = 5.0, 3.2
"""What report and export may take beside writing the same columns without labcrane."""

PARTICIPANTS = 9


def rows(*, brief: bool = False) -> list[Row]:
    """Return what report and export take per participant, and how that grows."""
    found = []
    participants = 3 if brief else PARTICIPANTS
    fewer = participants // 3
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        short, long = record(root / "short", 4), record(root / "long", 8)
        many = multiply(short, root / "many", participants)
        few = multiply(short, root / "few", fewer)
        longer = multiply(long, root / "longer", fewer)
        plain = plain_s(many)
        for words in COMMANDS:
            all_, some, twice = (measured(words, data) for data in (many, few, longer))
            what = " ".join(words)
            each = (all_.processor_s - some.processor_s) / (participants - fewer)
            limit = REPORT_TIMES if words == ("report",) else EXPORT_TIMES
            found += [
                Row(
                    "analysis", f"{what}, s per participant", each, plain, "h5py to pyarrow", limit
                ),
                Row(
                    "analysis", f"{what}, {participants} participants, MB at most",
                    all_.megabytes, some.megabytes, f"{fewer} participants", 1.15,
                ),
                Row(
                    "analysis", f"{what}, sessions twice as long, s", twice.processor_s,
                    some.processor_s, "as they are", 1.6,
                ),
                Row(
                    "analysis", f"{what}, sessions twice as long, MB at most", twice.megabytes,
                    some.megabytes, "as they are", 1.3,
                ),
            ]  # fmt: skip
    return found


def measured(words: Sequence[str], data: Path) -> Use:
    """Run a command on a data folder, in one process, because only its own time is measured."""
    with tempfile.TemporaryDirectory() as out:
        options = ["--out", f"{out}/out", *words[1:], "--include", "simulated", "--workers", "1"]
        return used(words[0], str(data), *options)


def main() -> None:
    """Print one line per command, number of participants and length."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--participants", type=int, default=36)
    parser.add_argument("--movements", type=int, default=4)
    asked = parser.parse_args()
    most, length = asked.participants, asked.movements
    cases = [(max(most // 4, 1), length), (max(most // 2, 1), length), (most, length)]
    cases += [(max(most // 4, 1), 2 * length)]
    print("command         participants  movements  s/participant  ms/movement  peak MB")
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        files = {n: record(root / f"length{n}", n) for n in {n for _, n in cases}}
        for count, movements in cases:
            data = multiply(files[movements], root / f"data-{count}-{movements}", count)
            for words in COMMANDS:
                use = measured(words, data)
                each = use.processor_s / count
                print(
                    f"{' '.join(words):16}{count:12}{8 * movements:11}{each:15.2f}"
                    f"{1000 * each / (8 * movements):13.1f}{use.megabytes:9.0f}",
                    flush=True,
                )
            shutil.rmtree(data)


if __name__ == "__main__":
    main()
