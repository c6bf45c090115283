"""What labcrane costs, each time beside a bare reference in the same run."""
