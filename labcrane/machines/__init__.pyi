"""The public names of this package, and the modules from which they are imported."""

from . import directions
from .actuator import ACTUATOR_PRESETS, ActuatorSettings
from .inverse_kinematics import reach
from .jointed_body import Hinge, Segment, beside, segments, stands
from .kinematics import Arm, jacobian, link_frames
from .library import load_machine
from .links import link_boxes
from .machine import GRAVITY, Body, Joint
from .meshes.mesh_file import MeshFile
from .meshes.reader import read_surface
from .meshes.solids import in_frame, read_solids, turned
from .meshes.surface import MeshError, Surface
from .rotation import rotation_matrix
from .scene import Geom, PlacedObject, Scene, ShapeKind, load_scene, place_objects
from .scene_codec import SCENE_PLACED, read_placed, write_placed
from .scene_part import Part, load_part
from .urdf import points_in_numbers, urdf_joint, urdf_link, urdf_of

__all__ = [
    "ACTUATOR_PRESETS",
    "GRAVITY",
    "SCENE_PLACED",
    "ActuatorSettings",
    "Arm",
    "Body",
    "Geom",
    "Hinge",
    "Joint",
    "MeshError",
    "MeshFile",
    "Part",
    "PlacedObject",
    "Scene",
    "Segment",
    "ShapeKind",
    "Surface",
    "beside",
    "directions",
    "in_frame",
    "jacobian",
    "link_boxes",
    "link_frames",
    "load_machine",
    "load_part",
    "load_scene",
    "place_objects",
    "points_in_numbers",
    "reach",
    "read_placed",
    "read_solids",
    "read_surface",
    "rotation_matrix",
    "segments",
    "stands",
    "turned",
    "urdf_joint",
    "urdf_link",
    "urdf_of",
    "write_placed",
]
