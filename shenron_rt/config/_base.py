"""What every configuration model shares: frozen, unknown keys refused, numbers of YAML 1.1 accepted."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict

from ..errors import InputError
from ..frames import Pose

__all__ = ["ConfigModel", "Vector3"]


class ConfigModel(BaseModel):
    """Base of the configuration models.

    Lax number parsing is wanted: PyYAML reads ``77e9`` as the string ``"77e9"`` (YAML 1.1 needs ``77.0e+9``).
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True)


def _three(value: tuple[float, ...]) -> tuple[float, float, float]:
    if len(value) != 3:
        raise ValueError(f"three numbers are needed, got {len(value)}")
    return (value[0], value[1], value[2])


Vector3 = Annotated[tuple[float, ...], AfterValidator(_three)]


class Placed(ConfigModel):
    """Something with a position and an orientation in its parent frame."""

    xyz_m: Vector3 = (0.0, 0.0, 0.0)
    ypr_deg: Vector3 = (0.0, 0.0, 0.0)

    @property
    def pose(self) -> Pose:
        """The pose in the parent frame."""
        if len(self.xyz_m) != 3 or len(self.ypr_deg) != 3:
            raise InputError("xyz_m and ypr_deg need three numbers each")
        x, y, z = self.xyz_m
        yaw, pitch, roll = self.ypr_deg
        return Pose((x, y, z), (yaw, pitch, roll))
