"""Benchmarks of labcrane, each compared with a bare reference in the same run."""
