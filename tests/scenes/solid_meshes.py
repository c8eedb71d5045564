"""Closed meshes and heightfields as MJCF, and their triangles in the world."""

import mujoco
import numpy as np
import trimesh


def mesh_asset(vertices: np.ndarray, faces: np.ndarray, name: str = "solid") -> str:
    """XML of a mesh; vertices (n, 3) [m]."""
    numbers = " ".join(f"{x:.9g}" for x in vertices.ravel())
    corners = " ".join(map(str, faces.ravel()))
    return f'<asset><mesh name="{name}" vertex="{numbers}" face="{corners}"/></asset>'


def heights_asset(heights: np.ndarray, half: float, most: float) -> str:
    """XML of a heightfield: heights (rows, columns) as shares of `most` [m], on a base of 10 cm."""
    numbers = " ".join(f"{x:.9g}" for x in heights[::-1].ravel())  # The first row in XML is at +Y.
    rows, columns = heights.shape
    return f"""<asset><hfield name="solid" nrow="{rows}" ncol="{columns}"
        size="{half} {half} {most} .1" elevation="{numbers}"/></asset>"""


def sphere(radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a sphere of 5,120 triangles."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return np.array(ball.vertices), np.array(ball.faces)


def bunny() -> tuple[np.ndarray, np.ndarray]:
    """A body of 24 cm with a head, two ears, feet and a tail: 5,120 triangles."""
    directions, faces = sphere(1.0)
    radius = np.full(len(directions), 0.085)
    for towards, height, width in (
        ((1.0, 0.0, 0.7), 0.045, 0.45),
        ((0.75, 0.35, 1.2), 0.09, 0.17),
        ((0.75, -0.35, 1.2), 0.09, 0.17),
        ((-1.0, 0.0, -0.1), 0.03, 0.2),
        ((0.6, 0.6, -0.8), 0.03, 0.3),
        ((0.6, -0.6, -0.8), 0.03, 0.3),
    ):
        cosine = directions @ np.array(towards) / np.linalg.norm(towards)
        radius += height * np.exp(-((np.arccos(np.clip(cosine, -1.0, 1.0)) / width) ** 2))
    return radius[:, None] * directions, faces


def bowl(radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Half a hollow sphere with an opening of `radius` at the top, z = 0, and walls of 1 cm."""
    angles = np.linspace(0.0, np.pi / 2, 17)
    arc = np.column_stack([np.sin(angles), -np.cos(angles)])
    shell = trimesh.creation.revolve(np.concatenate([(radius + 0.01) * arc, radius * arc[::-1]]))
    return np.array(shell.vertices), np.array(shell.faces)


def forearm() -> tuple[np.ndarray, np.ndarray]:
    """A tapered limb of 26 cm along Z: 5,120 triangles."""
    vertices, faces = sphere(1.0)
    along = vertices[:, 2:]
    thickness = 0.034 - 0.009 * along + 0.012 * np.exp(-(((along + 0.4) / 0.36) ** 2))
    return vertices * np.hstack([thickness, 0.85 * thickness, np.full_like(along, 0.13)]), faces


def slope(tangent: float) -> tuple[np.ndarray, np.ndarray]:
    """A slab of 1.2 m x 0.6 m x 0.1 m whose top falls along X; its middle is the origin."""
    slab = trimesh.creation.box((1.2, 0.6, 0.1))
    slab.apply_translation((0.0, 0.0, -0.05))
    return np.array(slab.vertices) @ turn(tangent).T, np.array(slab.faces)


def turn(tangent: float) -> np.ndarray:
    """Rotation (3, 3) about Y by which X falls at a slope."""
    cosine = 1.0 / np.sqrt(1.0 + tangent**2)
    sine = tangent * cosine
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def mesh_in_world(
    model: mujoco.MjModel, data: mujoco.MjData, geom: str
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) [m] and faces (m, 3) of a mesh geom where `data` has it."""
    mesh = model.mesh(model.geom(geom).dataid[0])
    first, count = mesh.vertadr[0], mesh.vertnum[0]
    vertices = model.mesh_vert[first : first + count].astype(float)
    faces = model.mesh_face[mesh.faceadr[0] : mesh.faceadr[0] + mesh.facenum[0]]
    pose = data.geom(geom)
    return vertices @ pose.xmat.reshape(3, 3).T + pose.xpos, np.array(faces)


def surface_of_heights(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of the first heightfield, with MuJoCo's diagonals."""
    rows, columns = model.hfield_nrow[0], model.hfield_ncol[0]
    x, y, most, _ = model.hfield_size[0]
    grid = np.meshgrid(np.linspace(-x, x, columns), np.linspace(-y, y, rows))
    heights = most * model.hfield_data.reshape(rows, columns)
    vertices = np.stack([*grid, heights], axis=-1).reshape(-1, 3)
    number = np.arange(rows * columns).reshape(rows, columns)
    lower, upper = number[:-1], number[1:]
    a, b, c, d = (x.ravel() for x in (lower[:, :-1], lower[:, 1:], upper[:, :-1], upper[:, 1:]))
    return vertices, np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, d, c])])
