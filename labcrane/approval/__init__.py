"""The approval of a study: the lock, its amendments, and what an ethics board reads.

Input: a protocol, all that it refers to, and the installed packages. Output: a lock that reports
every difference, a codebook, and a Methods paragraph.
"""
