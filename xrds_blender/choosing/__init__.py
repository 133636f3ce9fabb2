"""Which mode, quality and samples: what is asked for becomes what is rendered."""
