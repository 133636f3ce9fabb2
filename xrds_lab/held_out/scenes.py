"""Builds the files that the list names."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from xrds_core.errors import UsageError

if TYPE_CHECKING:
    from .stage import Set

LIST = Path(__file__).with_name("list.toml")


@dataclass(frozen=True)
class Listed:
    """A scene of the list: what it shows, what moves, and the assets that it takes."""

    name: str
    shows: str
    moves: str
    models: tuple[str, ...]
    skies: tuple[str, ...]
    textures: tuple[str, ...]

    def files(self, assets: Path) -> Iterator[Path]:
        """The files and folders that must be there."""
        yield from (assets / f"models/{name}.glb" for name in self.models)
        yield from (assets / f"hdris/{name}.exr" for name in self.skies)
        yield from (assets / "textures" / name for name in self.textures)


def listed() -> list[Listed]:
    """All scenes, in the order of the list."""
    entries = tomllib.loads(LIST.read_text("utf-8"))
    return [
        Listed(
            name, **{k: tuple(v) if isinstance(v, list) else v for k, v in e.items()}
        )
        for name, e in entries.items()
    ]


def builders() -> dict[str, Callable[[Set], None]]:
    """What builds each scene, by its name in the list."""
    from . import interiors, outdoors, stills

    made = (
        interiors.reading_room,
        interiors.corridor,
        interiors.night_market,
        interiors.smoky_store,
        stills.tea_table,
        stills.metal_and_glass,
        stills.wax_and_fur,
        outdoors.meadow,
        stills.toy_race,
        outdoors.walking_figure,
    )
    return {build.__name__.replace("_", "-"): build for build in made}


def build(assets: Path, out: Path, names: Sequence[str] = ()) -> Iterator[Path]:
    """Write NAME.blend of each scene, or of `names`, into `out`; yields the paths.

    Files hold all that they need. Raises UsageError, before anything is built, for
    names that the list has not and for assets that are not there.
    """
    import bpy

    from .stage import JUDGED, open_set

    known = {scene.name: scene for scene in listed()}
    unknown = sorted(set(names) - set(known))
    if unknown:
        raise UsageError(
            f"no scenes {', '.join(unknown)}: there are {', '.join(known)}"
        )
    wanted = [known[name] for name in names or known]
    missing = [p for scene in wanted for p in scene.files(assets) if not p.exists()]
    if missing:
        raise UsageError(f"assets are missing: {', '.join(map(str, missing))}")
    out.mkdir(parents=True, exist_ok=True)
    made = builders()
    for scene in wanted:
        stage = open_set(assets)
        made[scene.name](stage)
        stage.scene.frame_set(JUDGED)
        bpy.ops.file.pack_all()
        path = out / f"{scene.name}.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), compress=True)
        yield path
