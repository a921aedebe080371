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
from .corner import dihedral_scattering_matrix, trihedral_scattering_matrix
from .near_range import infinite_plate_rcs, near_range_disc_rcs, near_range_plate_rcs
from .polygon import polygon_integral

__all__ = [
    "cylinder_rcs",
    "dihedral_rcs",
    "dihedral_scattering_matrix",
    "disc_rcs",
    "ellipsoid_rcs",
    "infinite_plate_rcs",
    "near_range_disc_rcs",
    "near_range_plate_rcs",
    "plate_rcs",
    "polygon_integral",
    "sphere_rcs",
    "tophat_rcs",
    "trihedral_rcs",
    "trihedral_scattering_matrix",
]
