"""Files that are written safely, and YAML that knows its lines.

In come bytes and models; out go files that are whole or were never written, locks that die with
their process, and errors that name file and line.
"""
