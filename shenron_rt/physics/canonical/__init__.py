"""Radar cross sections to hold a solver against: closed forms, exact series, exact physical-optics integrals."""

from __future__ import annotations

from .classical import (
    cylinder_rcs,
    dihedral_rcs,
    disc_rcs,
    ellipsoid_rcs,
    plate_rcs,
    sphere_rcs,
    tophat_rcs,
    trihedral_rcs,
)
from .convex import (
    box_amplitude,
    box_scattering_matrix,
    cylinder_amplitude,
    disc_amplitude,
    disc_scattering_matrix,
    plate_amplitude,
    plate_scattering_matrix,
)
from .corner import dihedral_scattering_matrix, trihedral_scattering_matrix
from .near_corner import near_range_dihedral_matrix, near_range_trihedral_matrix, near_range_trihedral_rcs
from .near_range import infinite_plate_rcs, near_range_disc_rcs, near_range_plate_rcs
from .polygon import polygon_transform
from .sphere import sphere_mie_amplitude, sphere_mie_rcs, sphere_po_amplitude, sphere_scattering_matrix
from .surface_integral import near_range_cylinder_rcs, near_range_surface_amplitude

__all__ = [
    "box_amplitude",
    "box_scattering_matrix",
    "cylinder_amplitude",
    "cylinder_rcs",
    "dihedral_rcs",
    "dihedral_scattering_matrix",
    "disc_amplitude",
    "disc_rcs",
    "disc_scattering_matrix",
    "ellipsoid_rcs",
    "infinite_plate_rcs",
    "near_range_cylinder_rcs",
    "near_range_dihedral_matrix",
    "near_range_disc_rcs",
    "near_range_plate_rcs",
    "near_range_surface_amplitude",
    "near_range_trihedral_matrix",
    "near_range_trihedral_rcs",
    "plate_amplitude",
    "plate_rcs",
    "plate_scattering_matrix",
    "polygon_transform",
    "sphere_mie_amplitude",
    "sphere_mie_rcs",
    "sphere_po_amplitude",
    "sphere_rcs",
    "sphere_scattering_matrix",
    "tophat_rcs",
    "trihedral_rcs",
    "trihedral_scattering_matrix",
]
