"""Benchmarks of labcrane, each time beside a bare reference in the same run."""
