"""pyrender's renderer with its costs taken out: baked vertex colours, frustum-culled tiles, no multisampling, no depth read-back.

Stock pyrender spends about half a millisecond of Python per node, lights every pixel, and renders, resolves and reads back
a multisampled depth buffer. Here the forward pass is one program with five uniforms and two GL calls per visible tile.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from hippodrome.core.types import FloatArray, Frame, IntArray
from hippodrome.sim.render.camera import FAR_M, NEAR_M, CameraSpec, projection
from hippodrome.sim.render.gl import gl, pyrender, shaders
from hippodrome.sim.scene.types import Tile

VERTEX_SHADER = """#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 colour;
uniform mat4 clip_from_world;
uniform vec3 eye;
uniform vec3 shift;
out vec3 ray;
out vec4 base;
out vec3 speck;
const mat3 ASKEW = mat3(0.48, 0.64, -0.60, -0.80, 0.60, 0.0, 0.36, 0.48, 0.80);
void main() {
    vec3 world = position + shift;
    ray = world - eye;
    base = colour;
    speck = ASKEW * world;
    gl_Position = clip_from_world * vec4(world, 1.0);
}
"""
# Koschmieder's law: contrast falls as exp(-extinction * distance) towards the haze colour.
FRAGMENT_SHADER = """#version 330 core
in vec3 ray;
in vec4 base;
in vec3 speck;
uniform vec3 haze;
uniform float extinction;
out vec4 pixel;
GRAINED
void main() {
    pixel = vec4(mix(haze, grained(), exp(-extinction * length(ray))), 1.0);
}
"""
SMOOTH = "vec3 grained() { return base.rgb; }"
# Solid texture (Perlin 1985, Peachey 1985): cells of three sizes, each with a tone hashed from where it is, cut by whatever
# surface lies there. The lattice is askew, so that walls and ground cut it into uneven shapes. What is finer than a pixel fades.
GRAIN = """
const float CELL_M[3] = float[](0.07, 0.25, 0.9);
float tone(vec3 cell) {
    ivec3 c = ivec3(floor(cell));
    uint h = uint(c.x) * 73856093u ^ uint(c.y) * 19349663u ^ uint(c.z) * 83492791u;
    h = (h ^ (h >> 15)) * 2246822519u;
    return float((h >> 16) & 65535u) / 32767.5 - 1.0;
}
vec3 grained() {
    float pixel_m = length(fwidth(speck));
    float grain = 0.0;
    for (int i = 0; i < 3; ++i) grain += clamp(1.5 - pixel_m / CELL_M[i], 0.0, 1.0) * tone(speck / CELL_M[i]);
    return clamp(base.rgb * (1.0 + base.a * grain), 0.0, 1.0);
}
"""
WIDEST_RAD = 0.49 * np.pi  # half the angle of a view that two planes can bound
UNIFORMS = ("clip_from_world", "eye", "shift", "haze", "extinction")
VERTEX_DTYPE = np.dtype([("position", "<f4", 3), ("colour", "u1", 4)])


class FlatPrimitive(pyrender.Primitive):  # type: ignore[misc]  # pyrender is untyped
    """A scene tile on the GPU, 16 bytes a vertex. Uploaded when first drawn and after ``replace``."""

    def __init__(self, tile: Tile) -> None:
        super().__init__(positions=tile.vertices_m)
        self.tile = tile
        self._stale = True

    def replace(self, tile: Tile) -> None:
        self.tile = tile
        self._stale = True

    def draw(self, fine: bool = True) -> None:
        """All faces, or only those that are large enough to be seen from afar."""
        if self._stale:
            self._upload()
        gl.glBindVertexArray(self._vaid)
        count = 3 * (len(self.tile.faces) if fine else self.tile.bold_faces)
        gl.glDrawElements(gl.GL_TRIANGLES, count, gl.GL_UNSIGNED_INT, None)

    def _add_to_context(self) -> None:
        self._vaid = gl.glGenVertexArrays(1)
        gl.glBindVertexArray(self._vaid)
        self._buffers = [int(b) for b in gl.glGenBuffers(2)]
        gl.glBindBuffer(gl.GL_ARRAY_BUFFER, self._buffers[0])
        gl.glBindBuffer(gl.GL_ELEMENT_ARRAY_BUFFER, self._buffers[1])
        gl.glVertexAttribPointer(0, 3, gl.GL_FLOAT, gl.GL_FALSE, VERTEX_DTYPE.itemsize, ctypes.c_void_p(0))
        gl.glVertexAttribPointer(1, 4, gl.GL_UNSIGNED_BYTE, gl.GL_TRUE, VERTEX_DTYPE.itemsize, ctypes.c_void_p(12))
        gl.glEnableVertexAttribArray(0)
        gl.glEnableVertexAttribArray(1)
        gl.glBindVertexArray(0)

    def _upload(self) -> None:
        vertices = np.zeros(len(self.tile.vertices_m), dtype=VERTEX_DTYPE)
        vertices["position"] = self.tile.vertices_m
        vertices["colour"][:, :3] = self.tile.rgb
        vertices["colour"][:, 3] = self.tile.grain
        faces = np.ascontiguousarray(self.tile.faces, dtype=np.uint32)
        gl.glBindVertexArray(self._vaid)
        gl.glBindBuffer(gl.GL_ARRAY_BUFFER, self._buffers[0])
        gl.glBufferData(gl.GL_ARRAY_BUFFER, vertices.nbytes, vertices, gl.GL_STATIC_DRAW)
        gl.glBufferData(gl.GL_ELEMENT_ARRAY_BUFFER, faces.nbytes, faces, gl.GL_STATIC_DRAW)
        self._stale = False


class LevelCamera(pyrender.Camera):  # type: ignore[misc]  # pyrender is untyped
    """pyrender's camera with our projection matrix."""

    def __init__(self, spec: CameraSpec) -> None:
        super().__init__(znear=NEAR_M, zfar=FAR_M)
        self.half_fov_rad = 0.5 * float(np.radians(spec.fov_deg))
        self._projection = projection(spec)

    def get_projection_matrix(self, width: int | None = None, height: int | None = None) -> FloatArray:
        return self._projection


class FlatRenderer(pyrender.renderer.Renderer):  # type: ignore[misc]  # pyrender is untyped
    """Draws the tiles of ``pyrender.Scene`` front to back; tells tiles, moving things and the sky apart by the node's name."""

    def __init__(
        self, width: int, height: int, haze: FloatArray, extinction_per_m: float, fine_range_m: float, grain: bool
    ) -> None:
        self._main_fb: int | None
        super().__init__(width, height)
        self.haze, self.extinction_per_m, self.fine_range_m = haze, extinction_per_m, fine_range_m
        self._program: int | None
        self._program, self._uniform = _compile(fragment_shader(grain))
        self._pixels = np.empty((height, width, 4), dtype=np.uint8)  # filled anew by every frame
        self._tiles: list[FlatPrimitive] = []
        self._bounds_m = np.zeros((0, 4))

    def delete(self) -> None:
        super().delete()
        if self._program is not None:
            gl.glDeleteProgram(self._program)
            self._program = None

    def _update_context(self, scene: Any, flags: int) -> None:
        if scene.meshes == self._meshes:
            return
        super()._update_context(scene, flags)
        self._tiles = [node.mesh.primitives[0] for node in sorted(scene.get_nodes(name="tile"), key=lambda n: n.mesh.name)]
        corners = [np.concatenate([p.positions[:, :2].min(axis=0), p.positions[:, :2].max(axis=0)]) for p in self._tiles]
        self._bounds_m = np.array(corners).reshape(-1, 4)

    def _sorted_mesh_nodes(self, scene: Any) -> list[tuple[FlatPrimitive, bool]]:
        """Visible tiles, and whether near enough for fine detail; nearest first, so that the depth test hides much early."""
        pose = scene.get_pose(scene.main_camera_node)
        camera = scene.main_camera_node.camera
        half_view_rad = camera.half_fov_rad
        if pose[2, 2] != 0.0:  # the view is pitched: its upper or lower corners reach farther to the sides
            half_view_rad = min(half_view_rad + abs(float(np.arcsin(pose[2, 2]))), WIDEST_RAD)
        seen, distance_m = visible_tiles(self._bounds_m, pose[:2, 3], -pose[:2, 2], half_view_rad, camera.zfar)
        return [(self._tiles[i], d < self.fine_range_m) for i, d in zip(seen, distance_m, strict=True)]

    def _forward_pass(self, scene: Any, flags: int, seg_node_map: Any = None) -> Frame:
        self._configure_main_framebuffer()
        gl.glViewport(0, 0, self.viewport_width, self.viewport_height)
        gl.glClear(gl.GL_DEPTH_BUFFER_BIT)  # the sky covers every pixel that nothing else does
        gl.glUseProgram(self._program)
        view, projection = self._get_camera_matrices(scene)
        eye = scene.get_pose(scene.main_camera_node)[:3, 3]
        gl.glUniformMatrix4fv(self._uniform["clip_from_world"], 1, gl.GL_TRUE, (projection @ view).astype(np.float32))
        gl.glUniform3f(self._uniform["eye"], *eye)
        gl.glUniform3f(self._uniform["haze"], *self.haze)
        gl.glUniform3f(self._uniform["shift"], 0.0, 0.0, 0.0)
        gl.glUniform1f(self._uniform["extinction"], self.extinction_per_m)
        for node in scene.get_nodes(name="moving"):
            node.mesh.primitives[0].draw()
        for primitive, fine in self._sorted_mesh_nodes(scene):
            primitive.draw(fine)
        self._draw_sky(scene, eye)
        return self._read_main_framebuffer(scene, flags)

    def _draw_sky(self, scene: Any, eye: FloatArray) -> None:
        """Last and at infinite depth, so that only the pixels left over are shaded."""
        gl.glUniform3f(self._uniform["shift"], *eye)
        gl.glUniform1f(self._uniform["extinction"], 0.0)
        gl.glDepthRange(1.0, 1.0)
        for node in scene.get_nodes(name="sky"):
            node.mesh.primitives[0].draw()
        gl.glDepthRange(0.0, 1.0)

    def _configure_main_framebuffer(self) -> None:
        if self._main_fb is None:
            self._main_cb, self._main_db = (int(b) for b in gl.glGenRenderbuffers(2))
            self._main_fb = int(gl.glGenFramebuffers(1))
            gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, self._main_fb)
            self._attach(self._main_cb, gl.GL_RGBA8, gl.GL_COLOR_ATTACHMENT0)
            self._attach(self._main_db, gl.GL_DEPTH_COMPONENT24, gl.GL_DEPTH_ATTACHMENT)
            gl.glEnable(gl.GL_DEPTH_TEST)
            gl.glDepthFunc(gl.GL_LEQUAL)
            gl.glEnable(gl.GL_CULL_FACE)
            gl.glDisable(gl.GL_BLEND)
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, self._main_fb)

    def _attach(self, buffer: int, storage: int, attachment: int) -> None:
        gl.glBindRenderbuffer(gl.GL_RENDERBUFFER, buffer)
        gl.glRenderbufferStorage(gl.GL_RENDERBUFFER, storage, self.viewport_width, self.viewport_height)
        gl.glFramebufferRenderbuffer(gl.GL_FRAMEBUFFER, attachment, gl.GL_RENDERBUFFER, buffer)

    def _delete_main_framebuffer(self) -> None:
        if self._main_fb is not None:
            gl.glDeleteFramebuffers(1, [self._main_fb])
            gl.glDeleteRenderbuffers(2, [self._main_cb, self._main_db])
            self._main_fb = None

    def _read_main_framebuffer(self, scene: Any, flags: int) -> Frame:
        """Colour only, (H, W, 4), bottom row first as GL has it: four channels are a plain copy, three would be repacked."""
        gl.glReadPixels(0, 0, self.viewport_width, self.viewport_height, gl.GL_RGBA, gl.GL_UNSIGNED_BYTE, self._pixels)
        return self._pixels


def visible_tiles(
    bounds_m: FloatArray, eye_m: FloatArray, ahead: FloatArray, half_fov_rad: float, far_m: float
) -> tuple[IntArray, FloatArray]:
    """Tiles (T, 4: x0, y0, x1, y1) that may touch the horizontal field of view: indices and distances [m], nearest first.

    A box is outside when its corner furthest along a plane's inward normal is behind that plane.
    """
    low, high = bounds_m[:, :2] - eye_m, bounds_m[:, 2:] - eye_m
    sin, cos = np.sin(half_fov_rad), np.cos(half_fov_rad)
    left = np.array([sin * ahead[0] + cos * ahead[1], sin * ahead[1] - cos * ahead[0]])
    right = np.array([sin * ahead[0] - cos * ahead[1], sin * ahead[1] + cos * ahead[0]])
    inside = np.ones(len(bounds_m), dtype=bool)
    for normal in (left, right, ahead):
        inside &= np.where(normal > 0, high, low) @ normal >= 0.0
    distance_m = np.linalg.norm(np.clip(0.0, low, high), axis=1)
    seen = np.flatnonzero(inside & (distance_m < far_m))
    order = seen[np.argsort(distance_m[seen], kind="stable")]
    return order.astype(np.int32), distance_m[order]


def fragment_shader(grain: bool) -> str:
    """The source, with or without the surfaces' grain."""
    return FRAGMENT_SHADER.replace("GRAINED", GRAIN if grain else SMOOTH)


def _compile(fragment: str) -> tuple[int, dict[str, int]]:
    """Program and uniform locations; a mistake in a shader or a name raises here, never silently at ``glUniform``."""
    parts = [
        shaders.compileShader(VERTEX_SHADER, gl.GL_VERTEX_SHADER),
        shaders.compileShader(fragment, gl.GL_FRAGMENT_SHADER),
    ]
    program = gl.glCreateProgram()
    for part in parts:
        gl.glAttachShader(program, part)
    gl.glLinkProgram(program)
    if not gl.glGetProgramiv(program, gl.GL_LINK_STATUS):
        raise RuntimeError(f"GL program does not link: {gl.glGetProgramInfoLog(program)!r}")
    for part in parts:
        gl.glDeleteShader(part)
    locations = {name: int(gl.glGetUniformLocation(program, name)) for name in UNIFORMS}
    absent = [name for name, location in locations.items() if location < 0]
    if absent:
        raise RuntimeError(f"GL program has no uniform {', '.join(absent)}")
    return int(program), locations
