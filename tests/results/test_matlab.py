"""MAT files that Octave loads, and the function that loads them all."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat

from labcrane import RecordingError
from labcrane.analysis import measures_of
from labcrane.analysis.cohort import Cohort
from labcrane_matlab import matlab
from labcrane_matlab.matlab import Matlab, fields
from labcrane_matlab.settings import MatlabSettings
from results.consumers import needs_octave, octave, table, under


@pytest.fixture(scope="module")
def folder(cohort: Cohort, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("matlab")
    Matlab(MatlabSettings()).export(iter(cohort.included), out)
    return out


READ = """
folder = argument; addpath(folder); s = read_labcrane(folder);
printf('time|%s\\n', strjoin(arrayfun(@(x) sprintf('%.17g', x), s.trials.movement_time, ...
    'UniformOutput', false)', '|'));
printf('pair|%s|%s\\n', s.trials.pair{1}, s.units.movement_time);
printf('who|%s|%s\\n', s.participants(2).name, s.participants(2).status);
data = s.participants(1).sessions{1}.streams.state;
printf('slew|%.17g|%s\\n', data.data.joint_angle_slew(1000), data.units.joint_angle_slew);
printf('columns|%d|%d\\n', numel(fieldnames(s.trials)), sum(isnan(s.trials.movement_time)));
"""


@pytest.mark.slow
@needs_octave
def test_read_labcrane_loads_everything_in_one_call(folder: Path, cohort: Cohort) -> None:
    said = table(octave(READ, folder))
    measured = pd.concat([measures_of(person) for person in cohort.included])
    np.testing.assert_array_equal(np.array(said["time"], float), measured["movement_time"])
    assert said["pair"] == [measured["pair"].iloc[0], "s"]
    assert said["who"] == ["P002", "complete"]
    _, session = next(cohort.included[0].sessions())
    slew = session.streams["state"].data["joint.angle.slew"][999]
    assert (float(said["slew"][0]), said["slew"][1]) == (slew, "rad")
    assert said["columns"] == [str(len(measured.columns)), "0"]


@pytest.mark.slow
def test_files_are_version_5(folder: Path) -> None:
    assert under(folder) == ["P001.mat", "P002.mat", "read_labcrane.m"]
    assert (folder / "P001.mat").read_bytes().startswith(b"MATLAB 5.0 MAT-file")
    content = loadmat(folder / "P001.mat", simplify_cells=True)["labcrane"]
    assert content["sessions"]["events"]["name"][0] == "session.start"


def test_texts_and_columns_that_are_read_later_are_in_the_file(tmp_path: Path) -> None:
    drawn = np.random.default_rng().standard_normal(100_000)
    words = np.array(["a", "", "längere Wörter, 漢字"])
    later = {"x" * 63: drawn, "none": np.empty(0), "of": words, "yes": drawn > 0}
    content = {"text": "Übung", "empty": "", "no_fields": {}, "one": 1.0}
    inside = {name: matlab.Later(lambda each=each: each) for name, each in later.items()}
    matlab.write_mat(tmp_path / "P001.mat", content | {"struct": inside})
    read = loadmat(tmp_path / "P001.mat")["labcrane"][0, 0]
    struct = read["struct"][0, 0]
    np.testing.assert_array_equal(struct["x" * 63], drawn[:, np.newaxis])
    np.testing.assert_array_equal(struct["yes"], (drawn[:, np.newaxis] > 0).astype(float))
    assert struct["yes"].dtype == float
    assert struct["none"].size == 0
    assert ["".join(each) for each in struct["of"][:, 0]] == words.tolist()
    assert (read["text"][0], read["empty"].size, read["one"][0, 0]) == ("Übung", 0, 1.0)


def test_fields_are_names_that_matlab_takes() -> None:
    long = "x" * 80
    names = fields(["a.b", "a b", "1st", "ä", long, long])
    assert names[:4] == ["a_b", "a_b_2", "x1st", "x_"]
    assert all(len(name) <= 63 for name in names)
    assert len(set(names)) == len(names)


def test_more_than_a_mat_file_holds_is_refused(
    cohort: Cohort, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(matlab, "LARGEST", 1000)
    with pytest.raises(RecordingError, match=r"P001 has .* GB of numbers; a MAT file of version 5"):
        Matlab(MatlabSettings()).export(cohort.included, tmp_path)
    assert under(tmp_path) == []
