"""PyBullet, imported without the line that it prints for everybody."""

from labcrane import quietly_imported

pybullet = quietly_imported("pybullet")
