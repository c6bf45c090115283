"""File names, tables and descriptions as BIDS writes them."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

MISSING = "n/a"


def label(text: str) -> str:
    """Return a value of an entity: letters and digits only."""
    return "".join(letter for letter in text if letter.isascii() and letter.isalnum())


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a description."""
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def write_tsv(path: Path, table: "pd.DataFrame") -> None:
    """Write a table with its header; what is missing is n/a."""
    text = table.to_csv(sep="\t", index=False, na_rep=MISSING, lineterminator="\n")
    path.write_text(text, encoding="utf-8")


def write_bare_tsv(path: Path, table: "pd.DataFrame") -> None:
    """Write numbers without a header, as motion and physio files are; compressed for .gz."""
    import gzip
    import io

    import pyarrow as pa
    from pyarrow import csv

    out = io.BytesIO()
    rows = pa.Table.from_pandas(table, preserve_index=False)
    csv.write_csv(rows, out, csv.WriteOptions(include_header=False, delimiter="\t"))
    text = out.getvalue()
    if table.isna().to_numpy().any():
        # Arrow writes what is missing as nothing; a lone n/a is what BIDS wants there.
        text = table.to_csv(
            sep="\t", index=False, header=False, na_rep=MISSING, lineterminator="\n"
        ).encode()
    # Without a time in its head, the same data are the same file.
    path.write_bytes(gzip.compress(text, mtime=0) if path.suffix == ".gz" else text)
