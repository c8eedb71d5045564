"""Profiles of motion."""


def smooth(progress: float) -> float:
    """Fraction of the way after a fraction of the time, with the least jerk from rest to rest.

    The largest speed is 1.875 ways per duration, the largest acceleration 5.77 per its square.
    """
    s = min(max(progress, 0.0), 1.0)
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
