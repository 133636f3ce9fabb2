"""The laboratory's commands, which join `xrds` by entry points."""
