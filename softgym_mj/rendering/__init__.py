"""Off-screen images and videos."""

from softgym_mj.rendering.offscreen import CameraView, Video

__all__ = ["CameraView", "Video"]
