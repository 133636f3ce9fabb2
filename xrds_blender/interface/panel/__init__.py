"""The panel: the modes side by side, their settings, and what a render will take."""
