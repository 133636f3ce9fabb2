"""Facts of the scene for the panel, which is drawn often."""

from __future__ import annotations

from typing import Any

from ...choosing.plan_facts import join_facts
from ...planning.facts import Facts, SceneFacts
from ...planning.settings import Settings
from ...scene.contents import scene_facts


class FactsCache:
    """Reads a scene again only after a change."""

    def __init__(self) -> None:
        self._known: dict[str, SceneFacts] = {}

    def forget(self, *_: Any) -> None:
        """For Blender's handlers: something has changed."""
        self._known.clear()

    def facts(self, scene: Any, layer: Any, settings: Settings) -> Facts:
        """Facts of a scene as the viewport shows it."""
        return join_facts(scene, settings, self.of_scene(scene, layer))

    def of_scene(self, scene: Any, layer: Any) -> SceneFacts:
        """Those of the scene alone, whatever it is rendered with."""
        graph = layer.depsgraph
        if graph is None:
            return SceneFacts()
        name = f"{scene.name} {layer.name}"
        if name not in self._known:
            self._known[name] = scene_facts(graph)
        return self._known[name]
