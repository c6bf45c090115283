"""R and Octave read the participant file as it is: every column, and nothing lost in it."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from labcrane.analysis.cohort import Cohort
from results.consumers import needs_octave, needs_r, octave, r, table

RHDF5 = """
suppressMessages(library(rhdf5)); file <- commandArgs(TRUE)[1]
nodes <- h5ls(file); nodes <- nodes[nodes$otype == "H5I_DATASET", ]
for (path in paste(sub("^/$", "", nodes$group), nodes$name, sep = "/")) {
  x <- as.vector(h5read(file, path))
  if (is.character(x)) cat(path, length(x), sum(nchar(x)), 0, sep = "|")
  else cat(path, length(x), sprintf("%.17g", sum(x, na.rm = TRUE)), sum(is.na(x)), sep = "|")
  cat("\\n")
}
"""
HDF5R = """
suppressMessages(library(hdf5r)); file <- H5File$new(commandArgs(TRUE)[1], "r")
for (path in list.datasets(file, recursive = TRUE)) {
  x <- as.vector(file[[path]]$read())
  cat("/", sep = "")
  if (is.character(x)) cat(path, length(x), sum(nchar(x)), 0, sep = "|")
  else cat(path, length(x), sprintf("%.17g", sum(x, na.rm = TRUE)), sum(is.na(x)), sep = "|")
  cat("\\n")
}
"""
OCTAVE = """
function show(path, x)
  if isstruct(x)
    for [value, name] = x
      show([path '/' name], value);
    end
  elseif ischar(x)
    % shorter texts of a column are padded
    size = sum(cellfun(@numel, cellfun(@deblank, num2cell(x, 2), 'UniformOutput', false)));
    printf('%s|%d|%d|0\\n', path, rows(x), size);
  else
    printf('%s|%d|%.17g|%d\\n', path, numel(x), sum(x(! isnan(x))(:)), sum(isnan(x(:))));
  end
end
show('', load('-hdf5', argument));
"""


@pytest.fixture(scope="module")
def path(cohort: Cohort) -> Path:
    return cohort.included[0].path


def expected(path: Path, *, letters: bool) -> dict[str, list[str]]:
    """Return length, sum (or letters, or bytes) and missing values of every data set."""
    found: dict[str, list[str]] = {}

    def visit(name: str, node: h5py.HLObject) -> None:
        if not isinstance(node, h5py.Dataset):
            return
        if node.dtype == np.float64:
            values = node[:]
            missing = int(np.isnan(values).sum())
            found[f"/{name}"] = [str(len(values)), repr(float(np.nansum(values))), str(missing)]
        else:
            texts = np.atleast_1d(node.asstr("utf-8")[()])
            size = sum(len(text if letters else text.rstrip().encode()) for text in texts)
            found[f"/{name}"] = [str(len(texts)), str(size), "0"]

    with h5py.File(path) as file:
        file.visititems(visit)
    return found


def compare(read: dict[str, list[str]], truth: dict[str, list[str]]) -> None:
    assert read.keys() == truth.keys()
    for name, (length, total, missing) in truth.items():
        assert read[name][0] == length, name
        assert float(read[name][1]) == pytest.approx(float(total), rel=1e-9, abs=1e-9), name
        assert read[name][2] == missing, name


@pytest.mark.slow
@needs_r
@pytest.mark.parametrize("script", [RHDF5, HDF5R], ids=["rhdf5", "hdf5r"])
def test_r_reads_every_column_of_a_participant_file(path: Path, script: str) -> None:
    truth = expected(path, letters=True)
    assert len(truth) > 100
    assert truth["/ses-01/streams/eyes/time"][2] == "0"
    compare(table(r(script, path)), truth)


@needs_octave
def test_octave_loads_every_column_of_a_participant_file(path: Path) -> None:
    truth = {
        # Octave makes names valid: ses_01
        name.replace("ses-01", "ses_01"): values
        for name, values in expected(path, letters=False).items()
    }
    compare(table(octave(OCTAVE, path)), truth)
