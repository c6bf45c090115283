"""Files of meshes, read by ourselves: what is damaged or hostile is refused in words.

In come STL and OBJ; out go triangles whose numbers are finite and whose corners are there.
"""

FORMATS = (".stl", ".obj")
