"""Tables of a cohort: one Arrow dataset over all participants, and measures that are kept.

In come participant files; out go Arrow batches by participant, session and trial, and measures that
were made once and are made again when a file, a program or a setting has changed.
"""
