"""Files of meshes, read by ourselves: what is damaged or hostile is refused in words.

In come STL, OBJ and glTF 2; out go triangles whose numbers are finite and whose corners are there.
"""

FORMATS = (".stl", ".obj", ".gltf", ".glb")
