"""Physics as functions of arrays: no files, no Mitsuba.

SI and radians throughout, except specific attenuation [dB/km] and weather in its customary units.
"""

from __future__ import annotations

from .antenna import AntennaPattern, CosinePattern, GaussianPattern, IsotropicPattern, TabulatedPattern
from .attenuation import fog_attenuation, gas_attenuation, liquid_water_content, rain_attenuation, two_way_loss
from .backscatter import constant_gamma, geometric_optics, kirchhoff, lambertian, small_perturbation
from .canonical import (
    box_amplitude,
    box_scattering_matrix,
    cylinder_amplitude,
    cylinder_rcs,
    dihedral_rcs,
    dihedral_scattering_matrix,
    disc_amplitude,
    disc_rcs,
    disc_scattering_matrix,
    ellipsoid_rcs,
    infinite_plate_rcs,
    near_range_disc_rcs,
    near_range_plate_rcs,
    plate_amplitude,
    plate_rcs,
    plate_scattering_matrix,
    polygon_integral,
    sphere_mie_amplitude,
    sphere_mie_rcs,
    sphere_po_amplitude,
    sphere_rcs,
    sphere_scattering_matrix,
    tophat_rcs,
    trihedral_rcs,
    trihedral_scattering_matrix,
)
from .energy import diffuse_albedo, diffuse_budget, limit_sigma0
from .fresnel import SlabCoefficients, backscatter_reflection, fresnel, fresnel_cos, layered, slab
from .link_budget import noise_power, rcs_from_power, received_power, snr
from .noise import noise_power_per_sample
from .permittivity import cole_cole_permittivity, conductor_permittivity, p2040_permittivity, water_permittivity
from .roughness import coherent_factor, rayleigh_height
from .two_ray import two_ray_factor

__all__ = [
    "AntennaPattern",
    "CosinePattern",
    "GaussianPattern",
    "IsotropicPattern",
    "SlabCoefficients",
    "TabulatedPattern",
    "backscatter_reflection",
    "box_amplitude",
    "box_scattering_matrix",
    "coherent_factor",
    "cole_cole_permittivity",
    "conductor_permittivity",
    "constant_gamma",
    "cylinder_amplitude",
    "cylinder_rcs",
    "diffuse_albedo",
    "diffuse_budget",
    "dihedral_rcs",
    "dihedral_scattering_matrix",
    "disc_amplitude",
    "disc_rcs",
    "disc_scattering_matrix",
    "ellipsoid_rcs",
    "fog_attenuation",
    "fresnel",
    "fresnel_cos",
    "gas_attenuation",
    "geometric_optics",
    "infinite_plate_rcs",
    "kirchhoff",
    "lambertian",
    "layered",
    "limit_sigma0",
    "liquid_water_content",
    "near_range_disc_rcs",
    "near_range_plate_rcs",
    "noise_power",
    "noise_power_per_sample",
    "p2040_permittivity",
    "plate_amplitude",
    "plate_rcs",
    "plate_scattering_matrix",
    "polygon_integral",
    "rain_attenuation",
    "rayleigh_height",
    "rcs_from_power",
    "received_power",
    "slab",
    "small_perturbation",
    "snr",
    "sphere_mie_amplitude",
    "sphere_mie_rcs",
    "sphere_po_amplitude",
    "sphere_rcs",
    "sphere_scattering_matrix",
    "tophat_rcs",
    "trihedral_rcs",
    "trihedral_scattering_matrix",
    "two_ray_factor",
    "two_way_loss",
    "water_permittivity",
]
