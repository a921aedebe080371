"""Batches: a plan's runs on processes of this machine or on a Dask cluster, resumable at any point."""

from __future__ import annotations

from ..config.plan import BatchPlan, load_plan
from .driver import BatchProgress, BatchResult, Failure, run_batch

__all__ = ["BatchPlan", "BatchProgress", "BatchResult", "Failure", "load_plan", "run_batch"]
