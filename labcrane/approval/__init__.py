"""What was approved, and whether what would run is still the same.

From the bottom up::

    source_tree   the files of a package, byte by byte
    materials     everything a protocol refers to
    difference    two versions of it compared, in words
    lock          the approval beside the protocol, sealed
    codebook      every column that a session records
    methods       the Methods paragraph of the paper
    decision      approve and amend
"""
