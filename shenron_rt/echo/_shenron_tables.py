"""Tables of the public C-Shenron code: tag numbers, internal classes, materials, and the corrections of both.

The numbers are those of ucsdwcsng/C-Shenron, commit a0e4433. The released tables are kept with their faults, since
parity is what they are for.
"""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray, IntArray
from ..errors import InputError
from ..tags import SemanticTag, tag_table

__all__ = [
    "CLASS_TO_MATERIAL", "CORRECTED_MATERIAL", "HUMAN", "HUMAN_PERMITTIVITY", "MATERIALS", "PERMITTIVITY",
    "RELEASED_CLASS", "ROUGHNESS_M", "UNLABELLED", "corrected_material", "material_of_class", "released_class",
    "released_material_of_tag",
]  # fmt: skip

#: Material numbers of the public code.
MATERIALS = ("unlabelled", "wood", "concrete", "human", "metal")
UNLABELLED, WOOD, CONCRETE, HUMAN, METAL = range(5)
#: Relative permittivity of each material as the released loss uses it; 1 for the human body makes it invisible.
PERMITTIVITY: FloatArray = np.array([1.0, 2.0, 5.24, 1.0, 100_000.0])
#: RMS roughness of each material as the released loss uses it [m].
ROUGHNESS_M: FloatArray = np.array([0.0, 0.0017, 0.0017, 0.01, 0.00005])
#: What the comment beside the released value of 1 says; |R|^2 = 0.35 at normal incidence, as skin at 77 GHz.
HUMAN_PERMITTIVITY = 15.0
#: Index = CARLA tag up to 0.9.13, value = internal class; Building and Fence are swapped.
RELEASED_CLASS: IntArray = np.array([0, 4, 2, 0, 11, 5, 0, 0, 1, 8, 12, 3, 7, 10, 0, 1, 0, 12, 6, 0, 0, 0, 0])
#: Index = internal class, value = material.
CLASS_TO_MATERIAL: IntArray = np.array([0, 2, 2, 2, 4, 4, 4, 4, 1, 1, 0, 3, 4, 4, 4, 4, 4, 4, 4])

# What is not listed has no echo: the road and its like have none in the public code either. Terrain, Static and Dynamic
# were dropped there; riders are people, not metal.
# fmt: off
_BY_MATERIAL: dict[int, tuple[str, ...]] = {
    WOOD: ("Vegetation", "Terrain"),
    CONCRETE: ("Sidewalks", "Buildings", "Walls", "Bridge", "Static", "Rock"),
    HUMAN: ("Pedestrians", "Rider"),
    METAL: ("Fences", "Poles", "TrafficLight", "TrafficSigns", "Car", "Truck", "Bus", "Train", "Motorcycle", "Bicycle",
            "Dynamic", "GuardRail"),
}
# fmt: on
#: Index = canonical tag (CARLA 0.9.14 and later), value = material.
CORRECTED_MATERIAL: IntArray = np.zeros(256, dtype=np.int64)
for _material, _names in _BY_MATERIAL.items():
    CORRECTED_MATERIAL[[SemanticTag[name] for name in _names]] = _material


def released_class(tags: IntArray) -> IntArray:
    """Return the internal class of tags in CARLA's numbering up to 0.9.13.

    Parameters
    ----------
    tags : (n,) integer array

    Raises
    ------
    InputError
        A tag the released table does not have; it ends at 22.
    """
    numbers = np.asarray(tags)
    if numbers.dtype.kind not in "iu":
        raise InputError(f"tags must be integers, got an array of {numbers.dtype}")
    wrong = (numbers < 0) | (numbers >= len(RELEASED_CLASS))
    if np.any(wrong):
        raise InputError(
            f"the released tag table knows 0 to {len(RELEASED_CLASS) - 1} (CARLA up to 0.9.13), got "
            f"{np.unique(numbers[wrong])[:8].tolist()}; name the table of later "
            "versions (ShenronRadarModel(tags='0.9.14'), --tag-table 0.9.14)"
        )
    return np.asarray(RELEASED_CLASS[numbers])


def material_of_class(classes: IntArray) -> IntArray:
    """Return the material of each internal class."""
    return np.asarray(CLASS_TO_MATERIAL[classes])


def corrected_material(tags: IntArray) -> IntArray:
    """Return the material of canonical tags by the corrected table."""
    return np.asarray(CORRECTED_MATERIAL[tags])


def released_material_of_tag(tags: IntArray) -> IntArray:
    """Return the material the released table gives to what canonical tags name.

    The released table is written in the numbering up to 0.9.13, where all vehicles were one tag and riders were
    pedestrians; a tag is translated there by its meaning. Tags that had no number there are unlabelled.
    """
    by_meaning = np.zeros(256, dtype=np.int64)
    for number, tag in tag_table("0.9.13").meaning.items():
        by_meaning[tag] = CLASS_TO_MATERIAL[RELEASED_CLASS[number]]
    vehicles = ("Truck", "Bus", "Train", "Motorcycle", "Bicycle")
    by_meaning[[SemanticTag[name] for name in vehicles]] = by_meaning[SemanticTag.Car]
    by_meaning[SemanticTag.Rider] = by_meaning[SemanticTag.Pedestrians]
    return np.asarray(by_meaning[tags])
