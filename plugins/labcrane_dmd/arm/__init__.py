"""The arm that moves by a model: its valves, its bodies in the engine, and its contacts."""
