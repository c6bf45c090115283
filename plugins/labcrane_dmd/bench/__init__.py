"""The bench: arms driven signal by signal, simulated or real, and measured."""
