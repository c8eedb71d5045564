"""Images and videos without a window."""

from softgym_mj.rendering.offscreen import CameraView, Video

__all__ = ["CameraView", "Video"]
