"""A window from which a file can be dragged, as from a file manager.

python3 drag_source.py FILE
"""

from __future__ import annotations

import sys
from pathlib import Path

import gi

gi.require_version("Gtk", "3.0")
from gi.repository import Gdk, Gtk  # the version is named first

path = Path(sys.argv[1])
window = Gtk.Window(title="Downloads", type=Gtk.WindowType.TOPLEVEL)
window.set_default_size(220, 80)
window.set_decorated(False)
box = Gtk.EventBox()
box.add(Gtk.Label(label=path.name))
box.drag_source_set(Gdk.ModifierType.BUTTON1_MASK, [], Gdk.DragAction.COPY)
box.drag_source_add_uri_targets()
box.connect("drag-data-get", lambda _, __, data, *___: data.set_uris([path.as_uri()]))
window.add(box)
window.connect("destroy", Gtk.main_quit)
window.move(20, 700)
window.show_all()
Gtk.main()
