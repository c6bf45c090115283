"""Pictures of the retrieval scenarios, from the operator's and from the side view.

python docs/scenes.py            # into docs/scenes: at the start, on the way, at the end
python docs/scenes.py casualty   # of one
"""

import shutil
import sys
import tempfile
from pathlib import Path

from PIL import Image

from labcrane.core import SessionState
from labcrane.feedback.preview import chosen
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import load
from labcrane.registry.registry import discover
from labcrane_view.settings import ViewSettings
from labcrane_view.view import View

HERE = Path(__file__).parent
RETRIEVAL = HERE.parent / "protocols" / "retrieval"
MOMENTS = {"start": 0.0, "way": 0.55, "end": 1.0}
"""Shares of a run."""

SIDE = {
    "casualty": {"eye": (0.4, -4.6, 2.2), "look": (0.25, -0.5, 0.5), "fov_deg": 60.0},
    "reach_through": {"eye": (2.85, 0.1, 1.3), "look": (1.6, 0.0, 0.85), "fov_deg": 80.0},
}
"""Cameras for scenes that the study's side view hides or cuts: the whole person, inside the car."""

SIZE = (1200, 450)

COLOURS = 256
"""They are enough to see what is where, and the files a quarter of the size."""


def study_of(name: str, folder: Path) -> Path:
    """Return a copy of the study with one scenario, and no learning before it."""
    shutil.copytree(RETRIEVAL, folder, ignore=shutil.ignore_patterns("hydraulic_arm"))
    path = folder / "protocol.yaml"
    lines = path.read_text(encoding="utf-8").splitlines()
    others = [line for line in lines if line.strip().startswith("- scenes/") and name not in line]
    stages = [line for line in lines if line.strip().startswith(("- practice", "- reference"))]
    left = [line for line in lines if line not in {*others, *stages}]
    path.write_text("\n".join([*left, ""]), encoding="utf-8")
    return path


def draw(name: str) -> None:
    """Run a scenario with the simulated operator, and write its pictures."""
    with tempfile.TemporaryDirectory(prefix="labcrane-") as place:
        path = study_of(name, Path(place) / "study")
        study = load(path, discover())
        frames, scene = chosen(study, None, 1, None)
        last = frames[-1]
        sys.stdout.write(f"{name}: {last.phase.name.lower()} after {last.elapsed:.1f} s\n")
        sys.stdout.flush()
        run = Rig.build(study, simulated=True).describe(study, participant_seed=0)
        settings = study.choices["views.operator"].settings
        if not isinstance(settings, ViewSettings):
            raise TypeError(f"the operator sees {settings}; pictures need a view")
        (side,) = settings.beside
        beside = (side.model_copy(update=SIDE.get(name, {})),)
        shown = {"display": "hidden", "size": SIZE, "beside": beside}
        view = View(settings.model_copy(update=shown), run.machine)
        view.open(run)
        try:
            view.update(SessionState(scene=scene))
            for moment, share in MOMENTS.items():
                frame = frames[round(share * (len(frames) - 1))]
                view.present(frame)
                view.present(frame)  # the first picture is drawn while textures are made
                picture = HERE / "scenes" / f"{name}-{moment}.png"
                view.save(picture)
                Image.open(picture).quantize(COLOURS).save(picture, optimize=True)
        finally:
            view.close()


if __name__ == "__main__":
    (HERE / "scenes").mkdir(exist_ok=True)
    for each in sys.argv[1:] or sorted(path.stem for path in (RETRIEVAL / "scenes").glob("*.yaml")):
        draw(each)
