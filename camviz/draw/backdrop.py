"""Pictures of scenery that stays, kept on the graphics card with their depth, so that only what moves is drawn anew."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from typing import Any

_READ, _DRAW = 0x8CA8, 0x8CA9  # GL_READ_FRAMEBUFFER, GL_DRAW_FRAMEBUFFER
_COLOUR_AND_DEPTH, _NEAREST = 0x4100, 0x2600
_BYTES, _DEPTH_BITS = 3, 32  # VTK_UNSIGNED_CHAR, and the depth of a VTK window: OpenGL copies depths of one kind only
KEPT = 2  # a draft's and a fine picture's


class Backdrops:
    """The last few backdrops of one off-screen VTK window."""

    def __init__(self, window: Any) -> None:
        self.window = window
        self._kept: OrderedDict[Hashable, Any] = OrderedDict()

    def put_back(self, key: Hashable) -> bool:
        """Copy the kept backdrop of this key into the window; False where there is none."""
        if key not in self._kept:
            return False
        self._kept.move_to_end(key)
        self._copy(self._kept[key], self.window.GetRenderFramebuffer())
        return True

    def keep(self, key: Hashable) -> None:
        """Keep what the window shows now."""
        from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLFramebufferObject

        store = self._kept.popitem(last=False)[1] if len(self._kept) == KEPT else vtkOpenGLFramebufferObject()
        store.SetContext(self.window)
        store.SaveCurrentBindingsAndBuffers()
        width, height = self.window.GetSize()
        store.PopulateFramebuffer(width, height, True, 1, _BYTES, True, _DEPTH_BITS, 0, False)
        store.RestorePreviousBindingsAndBuffers()
        self._copy(self.window.GetRenderFramebuffer(), store)
        self._kept[key] = store

    def _copy(self, source: Any, target: Any) -> None:
        width, height = self.window.GetSize()
        extent = (0, width, 0, height)
        source.SaveCurrentBindingsAndBuffers()
        source.Bind(_READ)
        source.ActivateReadBuffer(0)
        target.Bind(_DRAW)
        target.ActivateDrawBuffer(0)
        source.Blit(extent, extent, _COLOUR_AND_DEPTH, _NEAREST)
        source.RestorePreviousBindingsAndBuffers()
