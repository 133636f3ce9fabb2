"""Training of `xrds_core.network.XRDS`; not part of the extension."""
