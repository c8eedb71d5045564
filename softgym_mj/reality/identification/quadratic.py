"""Quadratics through evaluations, and where they are least."""

import numpy as np

_RIDGE = 1e-6  # Of the mean square of the design's columns: against directions without evaluations.


def coefficients(dimensions: int) -> int:
    """How many a quadratic has."""
    return (dimensions + 1) * (dimensions + 2) // 2


def minimum(points: np.ndarray, values: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Where a quadratic through values (n,) at points (n, d) is least within bounds (d, 2): (d,).

    In a direction in which it falls for ever, that is at the edge.
    """
    middle, scale = points.mean(axis=0), np.maximum(points.std(axis=0), 1e-9)
    x = (points - middle) / scale
    first, second = np.triu_indices(x.shape[1])
    design = np.column_stack([np.ones(len(x)), x, x[:, first] * x[:, second]])
    square = design.T @ design
    square[np.diag_indices_from(square)] += _RIDGE * np.trace(square) / len(square)
    solution = np.linalg.solve(square, design.T @ (values - values.mean()))
    gradient, hessian = solution[1 : 1 + x.shape[1]], np.zeros((x.shape[1],) * 2)
    hessian[first, second] += solution[1 + x.shape[1] :]
    edges = (bounds - middle[:, None]) / scale[:, None]
    return middle + scale * _least(gradient, hessian + hessian.T, edges)


def _least(gradient: np.ndarray, hessian: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """The sum of the ways to the least along the principal axes, none of which leaves bounds."""
    values, vectors = np.linalg.eigh(hessian)
    slopes = vectors.T @ gradient
    way = np.zeros(len(gradient))
    for value, slope, axis in zip(values, slopes, vectors.T, strict=True):
        towards = -np.sign(slope) * axis
        room = np.where(towards > 0.0, bounds[:, 1], bounds[:, 0])
        there = np.abs(towards) > _RIDGE
        far = max(float(np.min(room[there] / towards[there])), 0.0)
        way += towards * (min(abs(slope) / value, far) if value > 0.0 else far)
    return np.clip(way, bounds[:, 0], bounds[:, 1])
