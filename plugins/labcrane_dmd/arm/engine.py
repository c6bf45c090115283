"""PyBullet, imported without the line that it prints for everybody."""

from labcrane.registry import quietly_imported

pybullet = quietly_imported("pybullet")
