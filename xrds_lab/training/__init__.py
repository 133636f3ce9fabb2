"""Training of `xrds_core.superres.network.XRDS`; not part of the extension."""
