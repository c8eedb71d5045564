"""Path-traced images and videos with Mitsuba 3 (extra `photo`)."""

from softgym_mj.rendering.photo.camera import SAMPLES, PhotoCamera, film, still

__all__ = ["SAMPLES", "PhotoCamera", "film", "still"]
