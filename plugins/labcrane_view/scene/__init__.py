"""Scene that a view shows: the forest, the machine, meshes and shaders, as triangles and nodes."""
