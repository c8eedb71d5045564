"""Photoreal stills and films: a renderer that follows light, Mitsuba 3 (extra `photo`)."""

from softgym_mj.rendering.photo.camera import SAMPLES, PhotoCamera, film, still

__all__ = ["SAMPLES", "PhotoCamera", "film", "still"]
