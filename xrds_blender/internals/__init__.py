"""What reads and writes Blender's own memory, and nothing else does.

Blender's Python interface has no word for four things that a render by XRDS needs. Each
module here finds the place in Blender's memory by what Blender's own properties show,
compares before it writes, and reads back what it has written. So an unknown Blender is
noticed and nothing is damaged:

- `borrowed`: size and persistent data of the running render. Where Blender keeps them
  otherwise, SceneError says so before anything is rendered.
- `spare_passes`: passes that the file has not asked for are taken out of the result.
  Otherwise they stay in it, and in multilayer files.
- `engine_override`: *Render with XRDS* in a scene that has another engine. Otherwise
  SceneError asks for the engine XRDS in its place.
- `status`: how far Cycles has come. Otherwise no time left is shown.

docs/compatibility.md says which Blender they were tried with.
"""
