"""The approval of a study: the lock, its amendments, and what an ethics board reads.

In come a protocol and all that it refers to; out go a lock that names every difference, a codebook
and a Methods paragraph.
"""
