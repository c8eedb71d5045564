"""`BareSheet`: a sheet of any mesh that is simulated and not drawn."""

import numpy as np

from softgym_mj.entities.fabric import Fabric
from softgym_mj.entities.sheet import Sheet
from softgym_mj.reality.meshes import Mesh


class BareSheet(Sheet):
    """A sheet without a skin: that of thousands of vertices takes longer to make than its motion.

    Attributes:
        mesh: what it is at rest; triangles that are folded upon each other keep their folds.
    """

    def _build(self, mesh: Mesh, fabric: Fabric | None = None, name: str = "sheet"):
        """Builds the sheet.

        Args:
            mesh: what it is at rest.
            fabric: what it is made of; None for a woven tablecloth.
            name: model name.
        """
        self.mesh = mesh
        self._start_sheet(name, fabric)
        self._set_mesh(mesh.points, mesh.triangles)

    def _mass(self, density: float) -> float:
        return density * self.mesh.area

    def _set_skin(self) -> None:
        """It has none."""

    def _skin(self, refinement: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        raise NotImplementedError("a BareSheet is not drawn")
