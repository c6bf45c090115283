"""Journals while people are recorded, one HDF5 file per participant afterwards.

From the bottom up::

    append_file      a file that only grows: one write per chunk, fsync in the background
    stream_header    what a stream holds, as XDF and LSL describe it
    xdf_chunk        how XDF packs its chunks
    xdf              the writer of XDF files                  xdf_reader   the tolerant reader
    journal          a session's frames and events            checks, chunks: what it stands on
    participant_file what is written into HDF5                recording    reads it
    consolidation    journals into a participant file         recover      whatever a crash left

The layout of the files is described in ``docs/file-format.md``.
"""
