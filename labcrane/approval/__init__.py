"""The approval of a study: the lock, its amendments, and what an ethics board reads.

In come a protocol and all that it refers to, and what is installed; out go a lock that names every
difference, a codebook, a Methods paragraph, and a bundle for a computer without network.
"""
