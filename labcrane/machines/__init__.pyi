"""The public names of this package, and the modules from which they are imported."""

from .actuator import ACTUATOR_PRESETS, Actuator, ActuatorSettings
from .inverse_kinematics import reach
from .kinematics import Arm, jacobian, link_frames
from .library import load_machine
from .links import link_boxes
from .machine import Body, Joint
from .mesh import MeshFile
from .meshes.reader import read_surfaces
from .meshes.surface import MeshError, Surface
from .scene import Geom, PlacedObject, Scene, ShapeKind, load_scene, place_objects
from .scene_codec import SCENE_PLACED, read_placed, write_placed
from .urdf import urdf_joint, urdf_link, urdf_of

__all__ = [
    "ACTUATOR_PRESETS",
    "SCENE_PLACED",
    "Actuator",
    "ActuatorSettings",
    "Arm",
    "Body",
    "Geom",
    "Joint",
    "MeshError",
    "MeshFile",
    "PlacedObject",
    "Scene",
    "ShapeKind",
    "Surface",
    "jacobian",
    "link_boxes",
    "link_frames",
    "load_machine",
    "load_scene",
    "place_objects",
    "reach",
    "read_placed",
    "read_surfaces",
    "urdf_joint",
    "urdf_link",
    "urdf_of",
    "write_placed",
]
