"""What the guide render leaves out, set on evaluated data and given back.

Light sampling is most of what a guide sample costs, and albedo and normal need none of
it. Worlds and emitting surfaces are not sampled any more but stay to be seen; lamps
lose their energy where no ray could end on them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ..internals.borrowed import Borrowed
from ..planning.plan import GuideRender, guide_bounces
from ..scene.closures import of_tree


@contextmanager
def guide_settings(depsgraph: Any, guides: GuideRender) -> Iterator[None]:
    """Hold the settings of a guide render on the evaluated scene."""
    with Borrowed() as borrowed:
        _set_paths(borrowed, depsgraph.scene_eval, guides)
        changed = list(_set_lights(borrowed, depsgraph, guides))
        for item in changed:
            item.update_tag()
        try:
            yield
        finally:
            borrowed.give_back()
            # The next pass is to see the lights again.
            for item in changed:
                item.update_tag()


def _set_paths(borrowed: Borrowed, scene: Any, guides: GuideRender) -> None:
    """Follow light only as far as albedo and normal need it."""
    borrowed.set(
        scene.cycles,
        max_bounces=min(guides.bounces, guide_bounces(scene.cycles.max_bounces)),
        diffuse_bounces=0,
        volume_bounces=0,
        use_fast_gi=False,
        use_guiding=False,
    )
    if not guides.shadows:
        borrowed.set(scene.cycles, light_sampling_threshold=1.0)


def _set_lights(
    borrowed: Borrowed, depsgraph: Any, guides: GuideRender
) -> Iterator[Any]:
    """Switch light sampling off; yields what Cycles has to look at again."""
    import bpy

    for item in depsgraph.ids:
        if isinstance(item, bpy.types.World) and not guides.sample_world:
            if item.cycles.sampling_method != "NONE":
                borrowed.set(item.cycles, sampling_method="NONE")
                yield item
        elif isinstance(item, bpy.types.Material) and not guides.sample_emitters:
            if item.cycles.emission_sampling != "NONE" and _emits(item):
                borrowed.set(item.cycles, emission_sampling="NONE")
                yield item
        elif isinstance(item, bpy.types.Light) and not guides.lamps and item.energy:
            borrowed.set(item, energy=0.0)
            yield item


def _emits(material: Any) -> bool:
    return material.node_tree is not None and of_tree(material.node_tree).emits
