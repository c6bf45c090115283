"""XDF 1.0: a writer, a tolerant reader, and checksums of what was written.

In come stream headers and samples; out go chunks that any XDF reader understands, and from a
damaged file whatever is still whole.
"""
