"""Scene entries whose coarse facets stand for round surfaces: rounded as finely as the scene's radars ask."""

from __future__ import annotations

import functools

from ..config.scene import MeshSource, Scene
from ..constants import SPEED_OF_LIGHT
from ..errors import InputError
from .mesh import TaggedMesh
from .rounding import TooManyFacesError, round_mesh

__all__ = ["MOST_ROUNDED_FACES", "Rounding"]

#: Wavelengths over how far facets may lie from a round surface: up to 0.4 rad of phase there and back. Over a facet
#: that phase is a parabola, whose spread of 0.3 times its height, 0.12 rad, takes 0.06 dB of its echo.
_FINENESS = 32.0
#: Shortest wavelength where a scene has no radar: the end of the automotive band at 81 GHz [m].
_NO_RADAR_M = SPEED_OF_LIGHT / 81e9
#: Triangles of all rounded bodies of a scene together: a program that renders 1.2 million of them peaks at 1.4 GB.
MOST_ROUNDED_FACES = 2_000_000


class Rounding:
    """Rounds the meshes of one scene, and bounds what all of them take together.

    Parameters
    ----------
    scene : Scene
        The highest carrier of its radars decides how finely.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._made = 0

    @functools.cached_property
    def tolerance_m(self) -> float:
        """How far facets may lie from the round surface [m]."""
        waves = [self._scene.profile_of(radar).wavelength_m for radar in self._scene.radars]
        return min(waves, default=_NO_RADAR_M) / _FINENESS

    def of(self, entry: MeshSource, mesh: TaggedMesh) -> TaggedMesh:
        """Return the mesh of an entry, rounded where the entry asks for it; parts and their order stay.

        Raises
        ------
        InputError
            The rounded bodies of the scene need more than ``MOST_ROUNDED_FACES`` triangles together.
        """
        if entry.round_below_deg is None:
            return mesh
        try:
            found = _rounded(mesh, self.tolerance_m, entry.round_below_deg, MOST_ROUNDED_FACES)
        except TooManyFacesError:
            raise self._too_many(entry) from None
        self._made += found.n_faces
        if self._made > MOST_ROUNDED_FACES:
            raise self._too_many(entry)
        return found

    def _too_many(self, entry: MeshSource) -> InputError:
        return InputError(
            f"{entry.name or 'mesh'}: round_below_deg {entry.round_below_deg:g}: within {1e3 * self.tolerance_m:.2g} mm"
            f" of their round surfaces the scene's rounded meshes need more than {MOST_ROUNDED_FACES} triangles; take a"
            " smaller angle, a mesh with fewer small parts, or leave the key out"
        )


# a mesh handed to one scene after another is rounded once; two of the largest are some 0.2 GB
@functools.lru_cache(maxsize=2)
def _rounded(mesh: TaggedMesh, tolerance_m: float, below_deg: float, most: int) -> TaggedMesh:
    return round_mesh(mesh, tolerance_m, below_deg=below_deg, most_faces=most)
