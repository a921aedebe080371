"""Returns -> AdcCube."""
