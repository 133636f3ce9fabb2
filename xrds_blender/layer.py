"""One view layer of one frame, inside `RenderEngine.render()`."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core.errors import Cancelled, OutOfMemory

from . import cycles_session, plan, status_bar, torch_folder
from .borrowed import Borrowed
from .colour import converted, to_rec709, working_space
from .cycles_settings import set_denoising, set_sampling
from .explain import find_facts
from .guides import GuideSource
from .job import STAGES, NetworkFailed, Picture, RenderJob
from .pass_names import COMBINED
from .passes import Beauty, CyclesPasses, Guides
from .picking import pick

if TYPE_CHECKING:
    from xrds_core import Upscaled, Upscaler

    from .cycles_session import Array


def render_layer(
    engine: Any, depsgraph: Any, job: RenderJob, start: float | None = None
) -> Picture:
    """Render the layer into the engine's result; the picture is of its first view.

    `start`, a reading of perf_counter, is where a time budget and the total begin.
    Raises Cancelled when the user stops it and XRDSError where it cannot be done, then
    with nothing written; but NetworkFailed, as for too little memory, with the
    low-resolution picture in the result, enlarged.
    """
    start = time.perf_counter() if start is None else start
    if job.is_picked:
        with CyclesPasses(engine, depsgraph) as passes:
            picked, decision = pick(passes, job, start)
            engine.report({"INFO"}, f"XRDS: {decision.value}: {decision.reason}")
            picture = render_layer(engine, depsgraph, picked)
        seconds = picture.seconds | {"total": time.perf_counter() - start}
        rest = () if picked.is_plain else picture.plan  # its reason stands above
        return replace(picture, seconds=seconds, plan=(decision, *rest), job=picked)
    seconds = dict.fromkeys(STAGES, 0.0)
    try:
        if job.is_plain:
            picture = _plain(engine, depsgraph, job, seconds)
        else:
            # first: missing weights are to cost no render
            upscaler = load_upscaler(job)
            picture = _enlarged(engine, depsgraph, job, upscaler, seconds)
    finally:
        status_bar.end()
    seconds["total"] = time.perf_counter() - start
    status_bar.keep(seconds)
    return picture


def _plain(
    engine: Any, depsgraph: Any, job: RenderJob, seconds: dict[str, float]
) -> Picture:
    """Cycles alone, exactly as its own engine would render."""
    keeps = engine.path_resolve("render").use_persistent_data
    name = depsgraph.view_layer_eval.name
    with Borrowed() as borrowed:
        set_sampling(borrowed, depsgraph.scene_eval, job.samples, job.seed)
        if job.denoiser is not None and cycles_session.has_denoiser():
            scene, layer = depsgraph.scene_eval, depsgraph.view_layer_eval
            set_denoising(borrowed, scene, layer, True, **job.denoising)
        try:
            clock = cycles_session.run(engine, depsgraph)
        finally:
            if not keeps:
                borrowed.forget()  # Cycles frees the evaluated scene as it syncs
                cycles_session.free(engine)
    _stop_if_cancelled(engine)
    seconds |= {"sync": clock.sync, "beauty": clock.render}
    result = engine.get_result()
    layer, size = result.layers[name], (result.resolution_x, result.resolution_y)
    view = next((view.name for view in result.views), "")
    pixels = cycles_session.read_pass(layer, COMBINED, view, size)
    assert pixels is not None
    return Picture(
        np.ascontiguousarray(pixels[..., :3]),
        np.ascontiguousarray(pixels[..., 3]),
        None,
        None,
        None,
        seconds,
        job.plan().decisions,
        peak_memory(),
    )


def _enlarged(
    engine: Any,
    depsgraph: Any,
    job: RenderJob,
    upscaler: Upscaler,
    seconds: dict[str, float],
) -> Picture:
    name = depsgraph.view_layer_eval.name
    with CyclesPasses(engine, depsgraph, noisy=True) as passes:
        facts = find_facts(depsgraph, job)
        chosen = job.plan(facts)
        if not chosen.motion_blur:
            passes.hold_still()
        source = GuideSource(passes, depsgraph, job, chosen, facts)
        beauties, guides, exposure = _passes(engine, job, chosen, passes, source)
    first = passes.views[0]
    stages = beauties[first].seconds, guides[first].seconds
    for key, value in [item for stage in stages for item in stage.items()]:
        seconds[key] += value
    decisions = (*chosen.decisions, source.decision)
    syncs = sorted(stage["sync"] for stage in stages)
    if syncs[0]:
        decisions += plan.after(syncs[1], syncs[0])
    started = time.perf_counter()
    status_bar.begin(engine, status_bar.NETWORK, 3)
    try:
        pictures = {
            view: _upscale(
                engine, upscaler, job, chosen, exposure, beauties[view], guides[view]
            )
            for view in passes.views
        }
    except (OutOfMemory, RuntimeError, MemoryError) as error:  # as torch raises them
        low = _bilinear_pictures(job.scale, beauties, guides)
        _write(engine, name, job.scale, low, beauties)
        told = str(error).partition("\n")[0] or "out of memory"
        kept = beauties[first]
        raise NetworkFailed(
            f"the network failed ({told}); the picture is the low-resolution one",
            kept.radiance,
            kept.alpha,
        ) from error
    _stop_if_cancelled(engine)
    seconds["network"] = time.perf_counter() - started
    started = time.perf_counter()
    _write(engine, name, job.scale, pictures, beauties)
    seconds["write"] = time.perf_counter() - started
    picture = pictures[first]
    return Picture(
        np.ascontiguousarray(picture[..., :3]),
        np.ascontiguousarray(picture[..., 3]),
        guides[first].albedo,
        guides[first].normal,
        beauties[first].radiance,
        seconds,
        decisions,
        peak_memory(),
        str(upscaler.device),
    )


def _passes(
    engine: Any,
    job: RenderJob,
    chosen: plan.Plan,
    passes: CyclesPasses,
    source: GuideSource,
) -> tuple[dict[str, Beauty], dict[str, Guides], float | None]:
    """Render both; the result then holds the guides' data passes at full size."""
    full = job.guides == "full"

    def guide(low: dict[str, Beauty] | None = None) -> dict[str, Guides]:
        status_bar.begin(engine, status_bar.GUIDES, 1 if full else 2)
        return source.guides(low)

    def beauty() -> tuple[dict[str, Beauty], float | None]:
        status_bar.begin(engine, status_bar.LOW, 2 if full else 1)
        low = passes.beauties(
            job.scale,
            job.samples,
            denoise=chosen.denoise,
            seed=job.seed,
            **job.denoising,
        )
        return low, job.exposure or passes.border_exposure()

    if not full:
        low, exposure = beauty()
        return low, guide(low), exposure
    # Fewer samples first: noise that matters, and one sync all the same.
    guides, data = guide(), passes.data_passes()
    low, exposure = beauty()
    passes.put_back(data)
    return low, guides, exposure


def load_upscaler(job: RenderJob) -> Upscaler:
    """The network of a job; the last one stays loaded for the next frame."""
    weights = None if job.weights is None else str(job.weights)
    upscaler = _load(job.preset, job.scale, job.guides, job.device, weights)
    if job.threads is not None:
        import torch

        torch.set_num_threads(job.threads)
    return upscaler


@lru_cache(maxsize=1)
def _load(
    preset: str, scale: int, guides: str, device: str, weights: str | None
) -> Upscaler:
    made: type[Upscaler] = torch_folder.load("upscaler").Upscaler
    return made(preset, scale, guides, device, weights=weights)


def _upscale(
    engine: Any,
    upscaler: Upscaler,
    job: RenderJob,
    chosen: plan.Plan,
    exposure: float | None,
    beauty: Beauty,
    guides: Guides,
) -> Array:
    """The region's radiance and alpha, (H, W, 4)."""
    rows, columns = beauty.offset
    matrix = to_rec709(working_space())

    def placed(guide: Array | None) -> Array | None:
        """Guides start where the first low-resolution pixel does."""
        if guide is None:
            return None
        margin = ((rows, 0), (columns, 0), *[(0, 0)] * (guide.ndim - 2))
        return np.pad(guide, margin, mode="edge")

    def seen(colour: Array | None) -> Array | None:
        """In the network's colour space."""
        if matrix is None or colour is None:
            return colour
        return converted(colour, matrix)

    def tell(done: float) -> bool:
        engine.update_stats("XRDS", f"Network {done:.0%}")
        engine.update_progress(done)
        return not cycles_session.is_stopped(engine)

    picture: Upscaled = upscaler(
        seen(np.concatenate([beauty.radiance, beauty.alpha[..., None]], -1)),
        placed(seen(guides.albedo)),
        placed(guides.normal),
        noisy=seen(beauty.noisy),
        guide_radiance=placed(seen(guides.radiance)),
        guide_alpha=placed(guides.alpha),
        guide_samples=guides.samples,
        exposure=exposure,
        memory_limit=job.memory_limit,
        progress=tell,
        skip_idle=chosen.skip_idle,
    )
    region = picture.radiance[rows:, columns:]
    return region if matrix is None else converted(region, np.linalg.inv(matrix))


def _write(
    engine: Any,
    name: str,
    scale: int,
    pictures: dict[str, Array],
    beauties: dict[str, Beauty],
) -> None:
    """Put the pictures and the enlarged light passes into the engine's result."""
    result = engine.get_result()
    layer = result.layers[name]
    for view, picture in pictures.items():
        cycles_session.write_pass(layer, COMBINED, view, picture)
        for other, low in beauties[view].others.items():
            large = _bilinear(low, scale, beauties[view].offset, picture.shape)
            cycles_session.write_pass(layer, other, view, large)
    engine.update_result(result)


def _bilinear_pictures(
    scale: int, beauties: dict[str, Beauty], guides: dict[str, Guides]
) -> dict[str, Array]:
    """By view, the region's radiance and alpha without a network, (H, W, 4)."""
    return {
        view: _bilinear(
            np.dstack((low.radiance, low.alpha)),
            scale,
            low.offset,
            guides[view].alpha.shape,
        )
        for view, low in beauties.items()
    }


def _bilinear(
    low: Array, scale: int, offset: tuple[int, int], shape: tuple[int, ...]
) -> Array:
    """Enlarge (h, w, channels) and cut the region out."""
    from xrds_core.baselines import bilinear

    rows, columns = offset
    large = bilinear(low, scale)
    return large[rows : rows + shape[0], columns : columns + shape[1]]


def _stop_if_cancelled(engine: Any) -> None:
    if cycles_session.is_stopped(engine):
        raise Cancelled


def peak_memory() -> int:
    """The largest memory in bytes that this process has taken; 0 where not known."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
