"""Sync report in the terminal: timestamp accuracy."""

from typing import TYPE_CHECKING

from labcrane.cli.output import out, print_rows

if TYPE_CHECKING:
    from labcrane.streams.sync.report.sync_report import SyncReport

STYLES = {"PASS": "green", "WARN": "yellow", "FAIL": "red"}


def print_report(report: "SyncReport") -> None:
    """Print a sync report: a row per stream, the loop, and what to do."""
    from labcrane.streams.sync.report.sync_report import COLUMNS

    verdict = report.verdict.value
    out.print(f"sync report: [{STYLES[verdict]}]{verdict}[/]")
    if report.streams:
        rows = report.table()
        print_rows(COLUMNS, rows, [STYLES[row[1]] for row in rows])
    if loop := report.loop:
        out.print(
            f"loop: {loop.verdict.value}, {loop.ticks} ticks, {loop.late} late, {loop.dropped} "
            f"missing; lateness p50 {1e3 * loop.lateness_p50_s:.3f} ms, "
            f"p99 {1e3 * loop.lateness_p99_s:.3f} ms, most {1e3 * loop.lateness_max_s:.2f} ms"
        )
    for line in report.details():
        out.print(f"  {line}", markup=False)
    for line in report.advice():
        out.print(f"  {line}", markup=False)
