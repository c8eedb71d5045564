"""`BareSheet`: a sheet of any mesh that is simulated and not rendered."""

from softgym_mj.entities.fabric import Fabric
from softgym_mj.entities.sheet import Sheet
from softgym_mj.reality.meshes import Mesh


class BareSheet(Sheet):
    """Sheet without a skin, which with thousands of vertices would take longer than the simulation.

    Attributes:
        mesh: mesh at rest; triangles that are folded onto each other keep their folds.
    """

    def _build(self, mesh: Mesh, fabric: Fabric | None = None, name: str = "sheet"):
        """Builds the sheet.

        Args:
            mesh: mesh at rest.
            fabric: the fabric; None for a woven tablecloth.
            name: model name.
        """
        self.mesh = mesh
        self._start_sheet(name, fabric)
        self._set_mesh(mesh.points, mesh.triangles)

    def _mass(self, density: float) -> float:
        return density * self.mesh.area

    def _skin(self, refinement: int) -> None:
        return None
