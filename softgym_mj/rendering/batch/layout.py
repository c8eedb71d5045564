"""NumPy dtypes of the structs of scene.h, which the kernel reads."""

import numpy as np

NOTHING, SHEET, ROPE, WATER = range(4)  # Kinds of deformable objects.
MATERIAL = [("color", "f4", 3), ("opacity", "f4"), ("specular", "f4"), ("shininess", "f4"),
             ("texture", "i4"), ("repeat", "f4")]  # fmt: skip
SOLID = np.dtype(
    [("shape", "i4"), ("mover", "i4"), ("label", "i4"), ("size", "f4", 3), ("position", "f4", 3),
     ("rotation", "f4", (3, 3)), ("material", MATERIAL)]
)  # fmt: skip
RIGID = np.dtype(
    [("mover", "i4"), ("label", "i4"), ("first_vertex", "i4"), ("num_vertices", "i4"),
     ("first_triangle", "i4"), ("num_triangles", "i4"), ("material", MATERIAL)]
)  # fmt: skip
LIGHT = np.dtype(
    [("direction", "f4", 3), ("diffuse", "f4", 3), ("ambient", "f4", 3), ("specular", "f4", 3),
     ("has_shadow", "i4")]
)  # fmt: skip
EYE = np.dtype(
    [("mover", "i4"), ("position", "f4", 3), ("rotation", "f4", (3, 3)), ("slope", "f4")]
)
TEXTURE = np.dtype(
    [("texels", "u8"), ("width", "i4"), ("height", "i4"), ("levels", "i4"), ("unused", "i4")]
)
ARRAYS = (
    "rigids", "solids", "lights", "eyes", "textures", "sky", "weight_starts", "weight_points",
    "weights", "around_starts", "around", "triangles", "texcoords", "rigid_places",
    "rigid_normals", "circle", "quarter",
)  # fmt: skip
SCENE = np.dtype(
    [
        *((name, "i4") for name in (
            "kind", "num_points", "num_vertices", "num_triangles", "num_parts", "part_vertices",
            "part_triangles", "num_glasses", "glass_vertices", "glass_triangles", "num_solids",
            "num_lights", "num_eyes", "sides", "rings_per_edge", "most_triangles",
        )),
        *((name, "f4") for name in ("inflate", "radius", "spacing", "voxel")),
        ("ambient", "f4", 3), ("headlight", "f4", 3), ("material", MATERIAL),
        *((name, "i4") for name in ARRAYS),
    ]
)  # fmt: skip
