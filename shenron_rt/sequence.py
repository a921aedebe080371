"""Frames one after the other: the rays of the next are cast while the last is still in work."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

from .config.profile import RadarProfile
from .config.scene import Scene
from .pipeline import Frame, SceneChain
from .scatterers import Scatterers
from .scene.motion_of import check_times

if TYPE_CHECKING:
    from .echo.shenron import ShenronModel

__all__ = ["simulate_sequence"]

#: Frames that are traced and not yet handed out; bounds memory.
_AHEAD = 2


def simulate_sequence(
    scene: Scene,
    profile: RadarProfile | None = None,
    *,
    frames: Iterable[int],
    radar: str | None = None,
    seed: int | None = None,
    rays: int = 300_000,
    max_bounces: int | None = None,
    model: str | ShenronModel = "physical",
    noise: str | None = "thermal",
    backend: str = "auto",
    accuracy: float = 1e-5,
    retrace: int = 1,
) -> Iterator[Frame]:
    """Render frames of one radar, ``scene.frame_period_s`` apart.

    Parameters
    ----------
    scene : Scene
    profile, radar, seed, rays, max_bounces, model, noise, backend, accuracy, retrace
        As for :func:`shenron_rt.simulate`.
    frames : iterable of int
        Frame k begins at k times the scene's frame period.

    Yields
    ------
    Frame
        In the order of ``frames``; the same bytes as calls of :func:`shenron_rt.simulate` give, each with the frame
        before it as ``previous``.

    Raises
    ------
    InputError
        Something of the scene has no pose at one of the frames, raised before the first; and what a frame raises.
    """
    mount = scene.radar(radar)
    chain = SceneChain(
        scene, mount, profile or scene.profile_of(mount), seed=seed, rays=rays, max_bounces=max_bounces,
        backend=backend, model=model, noise=noise, accuracy=accuracy, retrace=retrace,
    )  # fmt: skip
    timed = [(k, k * scene.frame_period_s) for k in frames]
    check_times(scene, (time + chain.profile.frame_mid_s for _, time in timed))
    if retrace == 1:
        yield from _overlapped(chain, timed)
        return
    last: Frame | None = None
    for k, time in timed:  # its rays are cast while its echoes are summed
        last = chain.frame(k, time, last)
        yield last


def _overlapped(chain: SceneChain, timed: Iterable[tuple[int, float]]) -> Iterator[Frame]:
    """Yield frames of (index, time [s]), each finished in a thread while the rays of the next are cast."""
    last: list[Frame | None] = [None]  # for what two frames tell together

    def finish(scatterers: Scatterers, time: float) -> Frame:
        frame = chain.finish(scatterers, time, last[0])
        last[0] = frame
        return frame

    waiting: deque[Future[Frame]] = deque()
    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="shenron-rt-frame") as worker:
        try:
            for k, time in timed:
                waiting.append(worker.submit(finish, chain.trace(k, time), time))
                if len(waiting) == _AHEAD:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()
