"""Journals while people are recorded, one HDF5 file per participant afterwards.

From the bottom up::

    append_file         a file that only grows: one write per chunk, fsync in the background
    parts               what journals are called
    stream_header       what a stream holds, as XDF and LSL describe it
    xdf_chunk           how XDF packs its chunks
    checks              which bytes are as they were written
    xdf                 the writer of XDF files
    chunks, samples     what a file holds, and past what is damaged
    xdf_reader          the tolerant reader
    journal             a session's frames and events
    journal_reader      the same, read back
    foreign_streams     the streams of others, with what is known of their times
    hdf5_columns        what R, MATLAB and Octave read alike
    answers, session_group, stream_group
                        what goes into a participant file
    participant_file    journals into a participant file
    recording           reads it
    recover             whatever a crash left
    recorrect           clocks corrected again, from the file alone
    relabelling         recordings under another pseudonym

The layout of the files is described in ``docs/file-format.md``.
"""
