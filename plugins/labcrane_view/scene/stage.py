"""The scene as the renderer knows it: forest, machine, targets and what cues draw."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from panda3d import core

from labcrane import FloatArray, Run
from labcrane.core import Shape, Sphere
from labcrane.machines import Body, read_placed, segments, stands
from labcrane_view.scene import shader
from labcrane_view.scene.body import body_mesh
from labcrane_view.scene.daylight import Daylight
from labcrane_view.scene.forest import forest, grid
from labcrane_view.scene.mesh import Mesh, cone, sphere
from labcrane_view.scene.mesh_reader import painted
from labcrane_view.scene.rams import Ram, hoses, rams
from labcrane_view.scene.things import pieces

SHADOWS, STILL = core.BitMask32.bit(5), core.BitMask32.bit(6)
"""Cameras of the shadow maps, of moving and of static objects; neither sees glowing or transparent
objects."""

SCENERY, MOVING = core.BitMask32.bit(7), core.BitMask32.range(8, 23)
"""Cameras that see the scenery alone, and those, a bit each, that see all but it."""

FULL = 4
"""Looks at a map of shadows for a soft edge."""

STILL_PICTURES = 3
"""Number of times that the shadows of static objects are drawn: textures are loaded from the second
on."""

PAINT = ((0.13, 0.13, 0.14, 1.0), (0.90, 0.66, 0.07, 1.0), (0.12, 0.38, 0.17, 1.0))
"""Colours of the frames: the foot, the column, and everything behind."""
LAST = (0.90, 0.66, 0.07, 1.0)
STEEL = (0.42, 0.44, 0.46, 1.0)
BARREL = (0.22, 0.23, 0.25, 1.0)
CHROME = (0.72, 0.74, 0.77, 1.0)
RUBBER = (0.05, 0.05, 0.055, 1.0)

GRID = (0.78, 0.80, 0.80, 1.0)

PLAIN_SUN, PLAIN_SKY = 0.96, 1.4
"""Of the light of sun and sky, where no shader adds the light from below."""

SKY_M = 150.0
"""Radius of the sky, in metres: behind everything that is drawn."""


class Stage:
    """Everything that can be seen.

    Parameters
    ----------
    daylight
        What lights it.
    shaders
        Whether the renderer runs our shader.
    shadow
        Edge of the shadow maps in pixels; 0 for none.
    soft
        Whether the edges of shadows are smoothed.
    scenery
        Whether there is anything but targets and cues.
    """

    def __init__(
        self,
        run: Run,
        daylight: Daylight,
        *,
        shaders: bool,
        shadow: int,
        scenery: bool,
        soft: bool = True,
    ) -> None:
        self.root = core.NodePath("stage")
        self._shaders = shaders
        self._ball = sphere()
        self._bar = cone((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0))
        self._parts: list[tuple[int, Any]] = []
        self._rams: list[tuple[Ram, Any, Any]] = []
        self._shown: dict[str, Any] = {}
        self._state = run.state
        self._scene = ""
        self._things: list[Any] = []
        self._moving: list[tuple[Any, slice, slice]] = []
        self._carried: list[tuple[Any, slice, slice]] = []
        self._scenery = scenery
        self._still_left = STILL_PICTURES
        self._still: Any = None
        self._cameras = 0
        if shaders:
            self._light(daylight, shadow, soft=soft)
        else:
            self._plain_light(daylight)
        if scenery:
            for thing in forest():
                node = self._add(self.root, thing.name, thing.mesh, thing.colour, thing.grain)
                node.hide(SHADOWS)
                node.show(STILL)
                _be_scenery(node)
            self._add_machine(run.bodies)
            self._add_rams(run)
            if shaders:
                self._add_sky()

    def place(self, frames: FloatArray, scene: str, state: FloatArray) -> None:
        """Set the machine's bodies and what stands around.

        ``frames`` as of :func:`labcrane.machines.link_frames`, ``scene`` as of
        :func:`labcrane.machines.read_placed`.
        """
        if self._scenery and scene != self._scene:
            self._furnish(scene)
        for node, position, orientation in (*self._carried, *self._moving):
            x, y, z, w = state[orientation].tolist()
            node.set_pos_quat(core.LPoint3(*state[position].tolist()), core.LQuaternion(w, x, y, z))
        for number, node in self._parts:
            node.set_mat(core.LMatrix4f(*frames[number].T.ravel().tolist()))
        for ram, barrel, rod in self._rams:
            foot, eye = ram.ends(frames)
            way = (eye - foot) / np.linalg.norm(eye - foot)
            _stretch(barrel, foot, foot + ram.barrel * way, ram.radius)
            # Not from the barrel's end: of two surfaces in one place either would be seen.
            _stretch(rod, foot + 0.3 * (eye - foot), eye, 0.5 * ram.radius)

    def _furnish(self, scene: str) -> None:
        """Set up what stands around; what moves is placed by the state from then on."""
        self._scene = scene
        for node in self._things:
            node.remove_node()
        self._things, self._moving = [], []
        said = {signal.name for signal in self._state.signals}
        for thing in read_placed(scene):
            for segment in segments(thing):
                node = self.root.attach_new_node(segment.name)
                where, yaw = stands(thing, segment.parts[0])
                node.set_pos(*where)
                node.set_h(math.degrees(yaw))
                for mesh, colour in pieces(thing, segment.parts):
                    self._add(node, segment.name, mesh, colour, 0.0)
                self._things.append(node)
                if f"scene.{segment.name}.position" in said:
                    self._moving.append((node, *self._places(f"scene.{segment.name}")))

    def _places(self, name: str) -> tuple[slice, slice]:
        """Return where the state holds a position and an orientation."""
        return self._state.find(f"{name}.position"), self._state.find(f"{name}.orientation")

    def show(self, shapes: Sequence[Shape]) -> None:
        """Draw ``shapes`` instead of those drawn before."""
        gone = set(self._shown) - {shape.name for shape in shapes}
        for name in gone:
            self._shown.pop(name).remove_node()
        for shape in shapes:
            node = self._shown.get(shape.name)
            if node is None:
                mesh = self._ball if isinstance(shape, Sphere) else self._bar
                node = self._shown[shape.name] = self._add(self.root, shape.name, mesh, STEEL, 0.0)
            self._colour(node, shape.colour)
            if isinstance(shape, Sphere):
                node.set_pos(*shape.centre)
                node.set_scale(shape.radius)
            else:
                _stretch(node, np.array(shape.start), np.array(shape.end), shape.radius)

    def look_from(self, camera: Any) -> None:
        """Tell the shader where the eye is."""
        if self._shaders:
            self.root.set_shader_input("eye", camera.get_pos(self.root))

    @property
    def has_scenery(self) -> bool:
        """Whether anything stands still that can be drawn once for all pictures."""
        return self._scenery and self._shaders

    def own_mask(self) -> Any:
        """Return a mask for one camera, with what only that camera sees; None after the 23rd."""
        bit = MOVING.get_lowest_on_bit() + self._cameras
        if bit > MOVING.get_highest_on_bit():
            return None
        self._cameras += 1
        return core.BitMask32.bit(bit)

    def add_sheet(self, sheet: Any, mask: Any) -> None:
        """Add what shows the scenery to a camera."""
        sheet.set_shader(self._backdrop)
        sheet.hide(~mask)

    def see_depth(self, eye: Any, near: float, far: float) -> None:
        """Make a camera see how far away what is solid is, from ``near`` to ``far`` metres."""
        state = core.NodePath("depth picture")
        made = core.Shader.make(core.Shader.SL_GLSL, shader.FAR_VERTEX, shader.FAR_FRAGMENT)
        state.set_shader(made, 100)
        state.set_shader_input("range", core.LVector2(near, far), 100)
        eye.set_initial_state(state.get_state())
        eye.set_camera_mask(SHADOWS | STILL)

    def _add_machine(self, bodies: Sequence[Body]) -> None:
        last = max((body.frame for body in bodies), default=0)
        for body in bodies:
            paint = (
                LAST if body.frame == last or body.moves else PAINT[min(body.frame, len(PAINT) - 1)]
            )
            node = self.root.attach_new_node(body.name)
            if body.mesh is not None:
                paint = painted(body.mesh, paint)
            self._add(node, body.name, body_mesh(body), paint, 0.0)
            if body.moves:
                self._carried.append((node, *self._places(body.moves)))
                continue
            if body.frame > 0 and body.mesh is None:
                self._add_joint(node, body)
            self._parts.append((body.frame, node))

    def _add_joint(self, node: Any, body: Body) -> None:
        """Add the pin at the inner end of a link, along the frame's z axis."""
        long = max(range(3), key=lambda axis: body.size[axis])
        if long == 0:  # along x: a link behind a pitch joint
            thick = body.size[1]
            inner = body.centre[0] - body.size[0] / 2.0
            across, round_ = 0.5 * body.size[2] + 0.06, 0.62 * thick
            pin = cone((inner, 0.0, -across), (inner, 0.0, across), (round_, round_), 20)
            self._add(node, f"{body.name} pin", pin, STEEL, 0.0)
            if (pipes := hoses(body)) is not None:
                self._add(node, f"{body.name} hoses", pipes, RUBBER, 0.0)

    def _add_rams(self, run: Run) -> None:
        """Add the cylinders, whose rods go in and out as the joints turn."""
        for ram in rams(run.machine, run.bodies):
            barrel = self._add(self.root, f"{ram.name} barrel", self._bar, BARREL, 0.0)
            rod = self._add(self.root, f"{ram.name} rod", self._bar, CHROME, 0.0)
            self._rams.append((ram, barrel, rod))

    def _add(
        self, parent: Any, name: str, mesh: Mesh, colour: Sequence[float], grain: float
    ) -> Any:
        node = parent.attach_new_node(_geometry(name, mesh))
        self._colour(node, colour)
        if self._shaders and colour[3] == 1.0:
            rough = shader.GROUND if grain == 1.0 else shader.ROUGH
            node.set_shader(self._programs[rough if grain > 0.0 else shader.SMOOTH])
        return node

    def _colour(self, node: Any, colour: Sequence[float]) -> None:
        red, green, blue, opacity = colour
        if self._shaders:
            node.set_shader_input("rgba", core.LVector4(red, green, blue, opacity))
            if opacity < 1.0:
                node.set_shader(self._programs[shader.GLASS])
            elif node.get_shader() == self._programs[shader.GLASS]:
                node.set_shader(self._programs[shader.SMOOTH])
        else:
            node.set_color(red, green, blue, opacity)
        if opacity < 1.0:
            node.set_transparency(core.TransparencyAttrib.M_alpha)
            node.set_depth_write(False)
            node.set_bin("transparent", 10)
            node.hide(SHADOWS)
        else:
            node.clear_transparency()
            node.set_depth_write(True)
            node.set_bin("opaque", 0)
            node.show(SHADOWS)
        node.hide(STILL | SCENERY)

    def drawn(self, gsg: Any) -> None:
        """Be told that a picture was drawn: shadows of what stands still need no other one."""
        if self._still is None or not self._still_left:
            return
        self._still_left -= 1
        if self._still_left:
            return
        buffer = self._still.get_shadow_buffer(gsg)
        if buffer is None:  # nothing lit has been drawn yet, so there is none
            self._still_left = 1
            return
        buffer.set_active(False)

    def grid(self) -> None:
        """Draw lines on the ground, a metre apart, as far as it is level."""
        node = self._add(self.root, "grid", grid(), GRID, 0.0)
        node.hide(SHADOWS | STILL)
        _be_scenery(node)

    def _add_sky(self) -> None:
        node = self.root.attach_new_node(_geometry("sky", self._ball))
        node.set_scale(SKY_M)
        node.set_shader(
            core.Shader.make(core.Shader.SL_GLSL, shader.SKY_VERTEX, shader.SKY_FRAGMENT)
        )
        node.set_two_sided(True)
        node.set_depth_write(False)
        node.set_bin("background", 0)
        node.hide(SHADOWS | STILL)
        _be_scenery(node)

    def _light(self, daylight: Daylight, shadow: int, *, soft: bool) -> None:
        depth = core.Shader.make(core.Shader.SL_GLSL, shader.DEPTH_VERTEX, shader.DEPTH_FRAGMENT)
        for order, (name, mask, wide) in enumerate(
            (("still", STILL, 48.0), ("moving", SHADOWS, 30.0))
        ):
            sun = core.DirectionalLight(name)
            sun.set_priority(-order)  # the shader knows them by their places
            node = self.root.attach_new_node(sun)
            node.set_pos(
                *(4.0 * (axis == 0) + 40.0 * part for axis, part in enumerate(daylight.sun))
            )
            node.look_at(4.0, 0.0, 0.0)
            if shadow:
                sun.set_shadow_caster(caster=True, buffer_xsize=shadow, buffer_ysize=shadow)
                lens = sun.get_lens()
                lens.set_film_size(wide, wide)
                lens.set_near_far(5.0, 90.0)
                sun.set_camera_mask(mask)
                state = core.NodePath("depth only")
                state.set_shader(depth, 100)
                state.set_attrib(core.ColorWriteAttrib.make(core.ColorWriteAttrib.C_off), 100)
                sun.set_initial_state(state.get_state())
                if mask is STILL:
                    self._still = sun
            self.root.set_light(node)
        taps = (FULL if soft else 1) if shadow else 0
        self._programs = {
            surface: core.Shader.make(
                core.Shader.SL_GLSL, shader.VERTEX, shader.fragment(surface, taps)
            )
            for surface in (shader.GROUND, shader.ROUGH, shader.SMOOTH, shader.GLASS)
        }
        self._backdrop = core.Shader.make(
            core.Shader.SL_GLSL, shader.BACKDROP_VERTEX, shader.backdrop(taps)
        )
        self.root.set_shader(self._programs[shader.SMOOTH])
        length = math.hypot(*daylight.sun)
        self.root.set_shader_inputs(
            sun=core.LVector3(*(part / length for part in daylight.sun)),
            sunlight=core.LVector3(*daylight.sunlight),
            above=core.LVector3(*daylight.above),
            below=core.LVector3(*daylight.below),
            eye=core.LVector3(0.0, 0.0, 0.0),
            haze=core.LVector3(*daylight.haze),
            zenith=core.LVector3(*daylight.zenith),
            thickness=daylight.thickness,
            glow=0.0,
            rgba=core.LVector4(1.0, 1.0, 1.0, 1.0),
            noise=_noise(),
            sunshine=core.LVector2(1.0, 0.0),
        )

    def _plain_light(self, daylight: Daylight) -> None:
        sun = core.DirectionalLight("sun")
        sun.set_color(core.LColor(*(PLAIN_SUN * part for part in daylight.sunlight), 1.0))
        sun.set_direction(core.LVector3(*(-part for part in daylight.sun)))
        sky = core.AmbientLight("sky")
        sky.set_color(core.LColor(*(PLAIN_SKY * part for part in daylight.above), 1.0))
        for light in (sun, sky):
            self.root.set_light(self.root.attach_new_node(light))


def _be_scenery(node: Any) -> None:
    """Let something be seen by cameras of the scenery, and not by those of what moves."""
    node.hide(MOVING)
    node.show(SCENERY)


def _stretch(node: Any, start: FloatArray, end: FloatArray, radius: float) -> None:
    """Set a bar of length and radius 1 along z to lie between two points."""
    axis = end - start
    length = float(np.linalg.norm(axis))
    z = axis / length
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x = x / np.linalg.norm(x)
    rows = [*(radius * x), 0.0, *(radius * np.cross(z, x)), 0.0, *axis, 0.0, *start, 1.0]
    node.set_mat(core.LMatrix4f(*(float(value) for value in rows)))


def _geometry(name: str, mesh: Mesh) -> Any:
    layout = core.GeomVertexFormat.get_v3n3()
    table = core.GeomVertexData(name, layout, core.Geom.UH_static)
    table.unclean_set_num_rows(len(mesh.points))
    rows = np.hstack([mesh.points, mesh.normals]).astype(np.float32)
    memoryview(table.modify_array(0)).cast("B")[:] = rows.tobytes()
    triangles = core.GeomTriangles(core.Geom.UH_static)
    triangles.set_index_type(core.Geom.NT_uint32)
    corners = triangles.modify_vertices()
    corners.unclean_set_num_rows(mesh.faces.size)
    memoryview(corners).cast("B")[:] = mesh.faces.astype(np.uint32).tobytes()
    geometry = core.Geom(table)
    geometry.add_primitive(triangles)
    node = core.GeomNode(name)
    node.add_geom(geometry)
    return node


def _noise(edge: int = 256) -> Any:
    """Return a texture of smooth noise that repeats without a seam."""
    random = np.random.default_rng(7)
    total = np.zeros((edge, edge))
    for octave in range(2, 8):
        cells = 2**octave
        # A spectrum cut off at the octave's frequency repeats by itself.
        waves = np.fft.fft2(random.normal(size=(edge, edge)))
        rate = np.hypot(*np.meshgrid(np.fft.fftfreq(edge), np.fft.fftfreq(edge))) * edge
        layer = np.fft.ifft2(waves * (rate < cells)).real
        total += layer / layer.std() / octave
    scaled = np.clip(0.5 + 0.18 * total / total.std(), 0.0, 1.0)
    texture = core.Texture("noise")
    texture.setup_2d_texture(edge, edge, core.Texture.T_unsigned_byte, core.Texture.F_luminance)
    texture.set_ram_image((255.0 * scaled).astype(np.uint8).tobytes())
    texture.set_minfilter(core.SamplerState.FT_linear_mipmap_linear)
    texture.set_wrap_u(core.SamplerState.WM_repeat)
    texture.set_wrap_v(core.SamplerState.WM_repeat)
    return texture
