"""`xrds stability`: stiff and extreme cases, measured and held to stated bounds."""
