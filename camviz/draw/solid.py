"""Solid pictures of things in space: VTK draws the surfaces, SVG the lines, marks and words that they do not hide.

The lines are those of the wireframe, theme and all, tested against the depth of the solid picture. VTK is used directly
rather than through PyVista's plotter, which was tried: a notebook's kernel then holds 460 MB rather than 380 (half of
the difference is matplotlib), the first picture comes more than a second later, and each takes three times as long.
PyVista's picture is the oracle of the tests.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from math import atan, ceil, degrees, log2
from time import perf_counter
from typing import Any
from zlib import crc32

import cv2
import numpy as np

from camviz.draw import svg
from camviz.draw.backdrop import Backdrops
from camviz.draw.items import Face, Item, TexturedMesh
from camviz.draw.marks import Marks
from camviz.draw.opengl import opengl_works
from camviz.draw.orbit_camera import OrbitCamera
from camviz.draw.picture import jpeg, png
from camviz.draw.wire import NEAR, Viewport, draw_lines, draw_marks
from camviz.lenses.base import Array

# Colours between those of the light and of the dark theme, good on both.
COLOURS = {
    "blue": "#2b8cd0", "orange": "#e0752e", "green": "#12a57e", "red": "#e0407f", "sky": "#58aee6", "yellow": "#d6a520",
    "purple": "#9a72d2", "ink": "#7b8494", "muted": "#7f8998", "grid": "#8f97a3", "shade": "#40454f",
}  # fmt: skip
DRAFT, FINE = 0.65, 1.1
SLOW = 0.005  # seconds for one pixel a picture unit, beyond which drafts are wireframes: a tenth of a change's time
_BACKGROUND = 128


def draw_solid(
    viewport: Viewport, items: Sequence[Item], name: str, draft: bool, scenery: tuple[Item, ...] = ()
) -> tuple[Marks, dict[str, bytes]]:
    """The content of a picture as wide and high as the viewport's camera, and photographs `name`-solid, `name`-mask.

    The photograph has FINE pixels per picture unit, or DRAFT. `scenery` stays while other things move: as long as its
    opaque sheets are seen from one place, they are drawn once.
    """
    staying = tuple(item for item in scenery if isinstance(item, TexturedMesh) and item.opacity == 1)
    items = [*(item for item in scenery if item not in staying), *items]
    shot = _stage().submit(_shoot, viewport, items, DRAFT if draft else FINE, staying).result()
    fragment, photographs = _cut_out(shot, viewport, name)
    fragment += draw_lines(viewport, items, shot.hides) + draw_marks(viewport, items, shot.hides)
    return fragment, photographs


@dataclass(frozen=True)
class SolidPicture:
    """A solid picture: uint8 rgb (h, w, 3) and alpha (h, w), its pixels per picture unit, and OpenGL's depth buffer.

    The buffer (h, w) holds d = (1/near - 1/z) / (1/near - 1/far), 1 where nothing is.
    """

    rgb: np.ndarray
    alpha: np.ndarray
    scale: float
    buffer: np.ndarray
    near: float
    far: float

    def depth(self, px: Array) -> Array:
        """The depth z (n,) in metres of what is solid at points (n, 2) in picture units, inf where nothing is."""
        height, width = self.buffer.shape
        u, v = np.floor(np.nan_to_num(px, nan=-1.0) * self.scale).clip(-1e6, 1e6).astype(int).T
        inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        d = np.where(inside, self.buffer[np.where(inside, v, 0), np.where(inside, u, 0)], 1).astype(float)
        return np.where(d < 1, self.near * self.far / (self.far - d * (self.far - self.near)), np.inf)

    def hides(self, px: Array, depth: Array) -> np.ndarray:
        """Which points, picture units (n, 2) at depths (n,), lie behind a surface by more than a hundredth."""
        return depth > 1.01 * self.depth(px)


def _cut_out(shot: SolidPicture, viewport: Viewport, name: str) -> tuple[Marks, dict[str, bytes]]:
    """The shot without its background: a JPEG and a mask take a tenth of the time of a picture with transparency."""
    k = viewport.camera.intrinsics
    mask, colour = png(shot.alpha), jpeg(shot.rgb, 88)
    id_ = f"{name}-{crc32(mask):08x}"
    photograph = svg.image(f"{name}-solid", 0, 0, k.width, k.height, mask=f"{name}-mask", mask_id=id_)
    return photograph, {f"{name}-solid": colour, f"{name}-mask": mask}


@cache
def _stage() -> ThreadPoolExecutor:
    """The one thread on which everything of VTK is made and used: an OpenGL context belongs to its thread."""
    return ThreadPoolExecutor(1, thread_name_prefix="camviz-solid")


@cache
def _studio() -> Studio:
    works, window = opengl_works()
    if not works:
        raise RuntimeError(window)
    return Studio(window)


def _shoot(
    viewport: Viewport, items: Sequence[Item], scale: float, staying: tuple[TexturedMesh, ...] = ()
) -> SolidPicture:
    studio, start = _studio(), perf_counter()
    shot = studio.shoot(viewport, items, scale, staying)
    studio.pace.append((perf_counter() - start) / scale**2)
    return shot


def too_slow() -> bool:
    """Whether even the fastest of the last few solid pictures took too long to be dragged."""
    pace = _studio().pace if _studio.cache_info().currsize else ()
    return len(pace) == 5 and min(pace) > SLOW


def rehearse(window: str) -> None:
    """Draw a square with the named window class and exit, 0 if it is seen, twice: for a process of its own."""

    def square() -> bool:
        viewport = Viewport(OrbitCamera().camera(64, 48), 5)
        corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
        sheet = TexturedMesh(
            corners, np.array([[0, 1, 2, 3]]), corners[:, :2] / 2 + 0.5, np.full((1, 1, 3), 255, np.uint8)
        )
        studio = Studio(window)
        first, nothing, again = (studio.shoot(viewport, [], 1, stays) for stays in ((sheet,), (), (sheet,)))
        seen = all(shot.alpha[24, 32] == 255 and shot.alpha[0, 0] == 0 for shot in (first, again))
        return bool(seen and not nothing.alpha.any() and (first.buffer == again.buffer).all())

    raise SystemExit(0 if _stage().submit(square).result() else 1)


class Studio:
    """An off-screen window that is kept, and the few actors that are dressed anew for every picture."""

    def __init__(self, window: str) -> None:
        from vtkmodules import vtkRenderingCore, vtkRenderingOpenGL2

        windows: Any = vtkRenderingCore if window == "vtkRenderWindow" else vtkRenderingOpenGL2
        self.window = getattr(windows, window)()
        self.window.SetOffScreenRendering(True)
        self.window.SetMultiSamples(0)
        self.window.SetAlphaBitPlanes(True)
        self.window.SetFrameBlitModeToNoBlit()
        self.renderer: Any = vtkRenderingCore.vtkRenderer()
        self.renderer.SetBackground(*[_BACKGROUND / 255] * 3)
        self.renderer.SetBackgroundAlpha(0)
        self.window.AddRenderer(self.renderer)
        for position, strength in (((-0.5, -1.0, -0.7), 0.75), ((0.9, -0.4, 0.6), 0.35)):
            light = vtkRenderingCore.vtkLight()
            light.SetPosition(position)
            light.SetIntensity(strength)
            self.renderer.AddLight(light)
        self.renderer.SetAutomaticLightCreation(False)
        self.opaque, self.clear = self._actor(), self._actor()
        self.sheets: dict[TexturedMesh, Any] = {}
        self.backdrops = Backdrops(self.window)
        self.size = np.zeros(2, dtype=int)
        self.pace: deque[float] = deque(maxlen=5)

    def shoot(
        self, viewport: Viewport, items: Sequence[Item], scale: float, staying: tuple[TexturedMesh, ...] = ()
    ) -> SolidPicture:
        """A picture of the faces and sheets, and of the opaque sheets that stay from one picture to the next."""
        faces = [item for item in items if isinstance(item, Face) and np.isfinite(item.vertices).all()]
        faces.sort(key=lambda face: -viewport.points_cam(face.vertices)[:, 2].mean())
        _dress(self.opaque, [face for face in faces if face.opacity == 1])
        _dress(self.clear, [face for face in faces if face.opacity < 1])
        self._hang([*staying, *(item for item in items if isinstance(item, TexturedMesh))])
        self._aim(viewport, [*staying, *items])
        self._open(*_pixels(viewport, scale))
        self._render(staying)
        return self._develop(viewport, scale)

    def _actor(self) -> Any:
        from vtkmodules.vtkCommonDataModel import vtkPolyData
        from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

        mapper, actor = vtkPolyDataMapper(), vtkActor()
        mapper.SetInputData(vtkPolyData())
        actor.SetMapper(mapper)
        actor.GetProperty().SetAmbient(0.4)
        actor.GetProperty().SetDiffuse(0.75)
        self.renderer.AddActor(actor)
        return actor

    def _hang(self, sheets: Sequence[TexturedMesh]) -> None:
        """One textured actor per sheet; a sheet that hangs already stays as it is, one that is gone frees its actor."""
        for sheet in set(self.sheets) - set(sheets):
            self.renderer.RemoveActor(self.sheets.pop(sheet))
        for sheet in sheets:
            if sheet not in self.sheets:
                self.sheets[sheet] = self._paper(sheet)

    def _paper(self, sheet: TexturedMesh) -> Any:
        """An actor of the sheet's shape and picture, unlit, for pictures bring their own light."""
        from vtkmodules.util.numpy_support import numpy_to_vtk

        actor = self._actor()
        there = np.isfinite(sheet.vertices.sum(axis=-1))
        quads = sheet.quads[there[sheet.quads].all(axis=-1)]
        data = _surface(np.where(there[:, None], sheet.vertices, 0), quads[:, [0, 1, 2, 0, 2, 3]])
        data.GetPointData().SetTCoords(numpy_to_vtk(sheet.uv * (1, -1) + (0, 1), deep=True))
        actor.GetMapper().SetInputData(data)
        actor.GetProperty().SetOpacity(sheet.opacity)
        actor.GetProperty().LightingOff()
        actor.GetProperty().SetAmbient(1)
        actor.GetProperty().SetDiffuse(0)
        alike = (hung.GetTexture() for other, hung in self.sheets.items() if other.picture is sheet.picture)
        actor.SetTexture(next(alike, None) or _texture(sheet.picture))
        return actor

    def _aim(self, viewport: Viewport, items: Sequence[Item]) -> None:
        """The camera of VTK where the viewport's is, with the same field of view and all solid things in range."""
        camera, k = self.renderer.GetActiveCamera(), viewport.camera.intrinsics
        R = viewport.camera.world_from_cam.rotation.as_matrix()
        camera.SetPosition(viewport.camera.centre)
        camera.SetFocalPoint(viewport.camera.centre + R[:, 2])
        camera.SetViewUp(-R[:, 1])
        camera.SetViewAngle(2 * degrees(atan(k.height / (2 * k.fy))))
        solid = [item.vertices for item in items if isinstance(item, Face | TexturedMesh)]
        depth = viewport.points_cam(np.concatenate(solid or [np.zeros((1, 3))]))[:, 2]
        depth = depth[np.isfinite(depth)]
        far = _power_of_2(max(1.05 * depth.max(initial=0), 2 * NEAR))
        near = _power_of_2(max(0.95 * depth.min(initial=far), far / 1e4, NEAR)) / 2
        camera.SetClippingRange(near, far)

    def _open(self, width: int, height: int) -> None:
        """Draw into the window's corner; the window only ever grows, for every change of its size costs memory."""
        self.size = np.maximum(self.size, (width, height))
        if tuple(self.size) != self.window.GetSize():
            self.window.SetSize(*self.size.tolist())
        self.renderer.SetViewport(0, 0, width / self.size[0], height / self.size[1])

    def _render(self, staying: Sequence[TexturedMesh]) -> None:
        """Draw all, but of what stays only a kept picture where there is one from here."""
        backdrop = [self.sheets[sheet] for sheet in staying]
        if backdrop:
            moving = [self.clear, self.opaque, *(self.sheets[sheet] for sheet in self.sheets.keys() - set(staying))]
            key = self._whence, *staying
            if not self.backdrops.put_back(key):
                self._draw_without(moving, onto=False)
                self.backdrops.keep(key)
        self._draw_without(backdrop, onto=bool(backdrop))

    def _draw_without(self, absent: Sequence[Any], *, onto: bool) -> None:
        """Draw all other actors, onto what the window holds or onto nothing."""
        self.renderer.SetPreserveColorBuffer(onto)
        self.renderer.SetPreserveDepthBuffer(onto)
        absent = [actor for actor in absent if actor.GetVisibility()]
        for actor in absent:
            actor.SetVisibility(False)
        self.window.Render()
        for actor in absent:
            actor.SetVisibility(True)

    @property
    def _whence(self) -> tuple[float, ...]:
        """All that a picture of the same things depends on: place, direction, angle, range and size."""
        camera = self.renderer.GetActiveCamera()
        seen = *camera.GetPosition(), *camera.GetFocalPoint(), *camera.GetViewUp(), camera.GetViewAngle()
        return *seen, *camera.GetClippingRange(), *self.renderer.GetViewport(), *self.size.tolist()

    def _develop(self, viewport: Viewport, scale: float) -> SolidPicture:
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkFloatArray, vtkUnsignedCharArray

        width, height = _pixels(viewport, scale)
        pixels, depths = vtkUnsignedCharArray(), vtkFloatArray()
        self.window.GetRGBACharPixelData(0, 0, width - 1, height - 1, False, pixels)
        self.window.GetZbufferData(0, 0, width - 1, height - 1, depths)
        rgba = cv2.flip(vtk_to_numpy(pixels).reshape(height, width, 4), 0)
        # The farthest of a point and its neighbours: a surface does not hide its own edges.
        farthest = cv2.dilate(cv2.flip(vtk_to_numpy(depths).reshape(height, width), 0), np.ones((3, 3)))
        alpha = cv2.extractChannel(rgba, 3)
        return SolidPicture(
            _unmixed(rgba, alpha), alpha, scale, farthest, *self.renderer.GetActiveCamera().GetClippingRange()
        )


def _pixels(viewport: Viewport, scale: float) -> tuple[int, int]:
    """Width and height of a picture with this many pixels a unit."""
    return round(scale * viewport.camera.intrinsics.width), round(scale * viewport.camera.intrinsics.height)


def _power_of_2(least: float) -> float:
    """The least power of 2 not below: a range of depths in such steps mostly stays while things move."""
    return 2.0 ** ceil(log2(least))


def _unmixed(rgba: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Colours (h, w, 3) without the background that shows through: c = alpha * colour + (1 - alpha) * background."""
    rgb = cv2.cvtColor(rgba, cv2.COLOR_RGBA2RGB)
    mixed = np.flatnonzero(alpha.ravel() - np.uint8(1) < 254)  # neither 0, which goes round to 255, nor 255
    share = alpha.ravel()[mixed, None] / 255
    pixels = rgb.reshape(-1, 3)
    pixels[mixed] = np.clip(np.rint((pixels[mixed] - (1 - share) * _BACKGROUND) / share), 0, 255)
    return rgb


def _dress(actor: Any, faces: Sequence[Face]) -> None:
    """Give an actor these faces, each in its own colour."""
    from vtkmodules.util.numpy_support import numpy_to_vtk

    count = [len(face.vertices) for face in faces]
    points = np.concatenate([face.vertices for face in faces]) if faces else np.empty((0, 3))
    colours = np.array([_rgba(face) for face in faces], dtype=np.uint8).reshape(-1, 4)
    triangles = [start + np.array([(0, i, i + 1) for i in range(1, n - 1)]).reshape(-1, 3)
                 for start, n in zip(np.cumsum(count) - count, count, strict=True)]  # fmt: skip
    data = _surface(points, np.concatenate(triangles) if triangles else np.empty((0, 3)))
    data.GetCellData().SetScalars(numpy_to_vtk(np.repeat(colours, [len(t) for t in triangles], axis=0), deep=True))
    actor.GetMapper().SetInputData(data)
    actor.SetVisibility(bool(faces))


def _texture(picture: np.ndarray) -> Any:
    """A picture (height, width, 3) as a texture whose v runs downwards, like the picture's rows."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkRenderingCore import vtkTexture

    image, texture = vtkImageData(), vtkTexture()
    image.SetDimensions(picture.shape[1], picture.shape[0], 1)
    image.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(picture).reshape(-1, 3)))
    texture.SetInputData(image)
    texture.InterpolateOn()
    texture.MipmapOn()
    texture.SetMaximumAnisotropicFiltering(1)  # 4, as VTK has it, takes half as long again without a graphics card
    return texture


def _surface(points: Array, triangles: np.ndarray) -> Any:
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    data, vertices, cells = vtkPolyData(), vtkPoints(), vtkCellArray()
    vertices.SetData(numpy_to_vtk(points, deep=True))
    cells.SetData(3, numpy_to_vtkIdTypeArray(triangles.astype(np.int64).reshape(-1), deep=True))
    data.SetPoints(vertices)
    data.SetPolys(cells)
    return data


def _rgba(face: Face) -> tuple[int, int, int, int]:
    red, green, blue = bytes.fromhex(COLOURS.get(face.colour, face.colour).removeprefix("#"))
    return red, green, blue, round(255 * face.opacity)
